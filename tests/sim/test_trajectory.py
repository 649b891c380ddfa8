"""Joint limits by finite differences of what is executed, straightness, and rest at both ends."""

import numpy as np
import pytest

from medor_cloth.integration import FRAME_S
from medor_sim.arm import PARKED
from medor_sim.kinematics import LOWER, UPPER, forward, solve
from medor_sim.trajectory import ACCELERATION, JERK, TOOL_ACCELERATION, VELOCITY, Line, Rest, Transit, frames

BASE = np.array([-0.5, 0.0, 0.0])
TICK_S = 0.001
"""Of the arm's controller."""


def haste(segment) -> list[float]:
    """Largest share of the limits on velocity, acceleration and jerk, rest before and after included."""
    times = np.arange(-5, np.ceil(segment.duration / TICK_S) + 6) * TICK_S
    motion = segment.joints(np.clip(times, 0, segment.duration))
    shares = []
    for limit in (VELOCITY, ACCELERATION, JERK):
        motion = np.diff(motion, axis=0) / TICK_S
        shares.append(float((np.abs(motion) / limit).max()))
    return shares


def pulls(count: int):
    rng = np.random.default_rng(0)
    starts = rng.uniform((-0.26, -0.26, 0.01), (0.26, 0.26, 0.08), (count, 3))
    way = rng.uniform((-0.5, -0.5, 0), 0.5, (count, 3))
    way *= rng.uniform(0.05, 0.2, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    return zip(starts, np.clip(starts + way, (-0.26, -0.26, 0), (0.26, 0.26, 0.25)), strict=True)


def line(start, end) -> Line:
    return Line(start, end, float(np.linalg.norm(end - start)) / 0.5, BASE)


def test_pulls_keep_within_the_limits_of_every_joint():
    shares = np.array([haste(line(*pull)) for pull in pulls(25)])
    assert shares.max() <= 1.001
    assert shares[:, 1].max() > 0.95  # accelerations are what is used up


def test_pulls_are_straight_at_the_speed_asked_for():
    for start, end in pulls(10):
        segment = line(start, end)
        points = forward(segment.joints(np.linspace(0, segment.duration, 200)), BASE).points
        along = (end - start) / np.linalg.norm(end - start)
        share = (points - start) @ along
        np.testing.assert_allclose(points, start + share[:, None] * along, atol=1e-7)
        np.testing.assert_allclose(points[[0, -1]], [start, end], atol=1e-7)
        speed = np.diff(share).max() / (segment.duration / 199)
        assert speed == pytest.approx(np.linalg.norm(end - start) / 0.5 / segment.stretch, rel=0.01)
        assert 1 <= segment.stretch < 1.5


def test_haste_is_stretched_away_without_leaving_the_line():
    start, end = np.array([-0.2, -0.25, 0.05]), np.array([-0.2, 0.25, 0.05])
    calm, hasty = Line(start, end, 0.05, BASE), Line(start, end, 2.0, BASE)
    assert calm.stretch == 1 < hasty.stretch
    assert max(haste(hasty)) == pytest.approx(1, abs=0.02)
    for segment in (calm, hasty):
        points = forward(frames(segment), BASE).points
        np.testing.assert_allclose(points[:, [0, 2]], np.broadcast_to([-0.2, 0.05], (len(points), 2)), atol=1e-6)


def test_transits_keep_their_share_of_the_limits_and_stay_between_their_ends():
    for point in ([0.0, 0.0, 0.12], [0.25, -0.25, 0.15], [-0.25, 0.2, 0.2]):
        end = solve(np.array([point]), BASE).joints[0]
        segment = Transit(PARKED, end, share=0.5)
        assert max(haste(segment)) <= 0.5 * 1.001
        way = segment.joints(np.linspace(0, segment.duration, 300))
        np.testing.assert_allclose(way[[0, -1]], [PARKED, end], atol=1e-9)
        assert (way >= np.minimum(PARKED, end) - 1e-9).all()
        assert (way <= np.maximum(PARKED, end) + 1e-9).all()
        assert ((way >= LOWER) & (way <= UPPER)).all()


def test_frames_end_at_the_end():
    segment = line(np.array([0.0, 0.0, 0.02]), np.array([0.1, 0.0, 0.05]))
    walked = frames(segment)
    assert len(walked) == int(np.ceil(segment.duration / FRAME_S))
    np.testing.assert_allclose(walked[-1], segment.joints(np.array([segment.duration]))[0])
    assert len(frames(Rest(PARKED, 0.1))) == 10
    assert (frames(Rest(PARKED, 0.1)) == PARKED).all()


def test_a_line_takes_its_ramps_longer_than_the_flying_picker():
    segment = line(np.array([0.0, 0.0, 0.02]), np.array([0.1, 0.0, 0.02]))
    assert 0.5 + 0.2 / TOOL_ACCELERATION <= segment.duration / segment.stretch < 0.5 + 2 * 0.2 / TOOL_ACCELERATION
