"""A pick-and-place of the arm as planned: every frame within limits and clear, the pull the flying picker's."""

import numpy as np
import pytest

from medor_cloth.integration import FRAME_S
from medor_sim.arm import OPEN_M, PARKED
from medor_sim.kinematics import LOWER, UPPER
from medor_sim.panda import CLOSED_M, OVER_M, hovering, plan
from medor_sim.trajectory import ACCELERATION, VELOCITY
from medor_wire.errors import OutOfReach, Refused

PICK, PLACE = np.array([0.05, -0.1, 0.0125]), np.array([0.15, 0.02, 0.06])
CORNERS = [(np.array([x, y, 0.0125]), np.array([0.8 * x, 0.8 * y, 0.1])) for x in (-0.26, 0.26) for y in (-0.26, 0.26)]


@pytest.fixture
def arm(world):
    world.arm.park()
    return world.arm


@pytest.mark.parametrize(("pick", "place"), [(PICK, PLACE), *CORNERS])
def test_no_frame_touches_the_table_or_the_arm_or_passes_a_limit(arm, pick, place):
    motion = plan(arm, pick, place)
    for joints, opening in zip(motion.joints, motion.openings, strict=True):
        arm.move_to(joints, opening)
        assert arm.touched() is None
    assert ((motion.joints >= LOWER) & (motion.joints <= UPPER)).all()
    speed = np.diff(np.vstack([PARKED, motion.joints]), axis=0) / FRAME_S
    assert (np.abs(speed) <= 1.001 * VELOCITY).all()
    assert (np.abs(np.diff(speed, axis=0)) / FRAME_S <= 1.001 * ACCELERATION).all()  # no jump between legs


def test_it_comes_from_above_pulls_straight_and_leaves_upwards(arm):
    motion = plan(arm, PICK, PLACE)
    tool = motion.poses.points
    grip, release = np.flatnonzero(motion.holding)[[0, -1]]
    np.testing.assert_allclose(tool[grip - 1], PICK, atol=1e-6)
    np.testing.assert_allclose(tool[release], PLACE, atol=1e-6)
    along = (PLACE - PICK) / np.linalg.norm(PLACE - PICK)
    pulled = tool[grip : release + 1] - PICK
    np.testing.assert_allclose(pulled, (pulled @ along)[:, None] * along, atol=1e-6)
    low = tool[:, 2] < OVER_M - 0.01  # a free move sinks a little between its ends
    beside = np.linalg.norm(tool[:, :2] - PICK[:2], axis=1), np.linalg.norm(tool[:, :2] - PLACE[:2], axis=1)
    assert (beside[0][:grip][low[:grip]] < 1e-6).all()
    assert (beside[1][release:][low[release:]] < 1e-6).all()
    np.testing.assert_allclose(tool[motion.done - 1], hovering(PLACE), atol=1e-6)
    np.testing.assert_allclose(motion.joints[-1], PARKED, atol=1e-9)


def test_the_gripper_is_closed_before_it_pulls_and_open_when_it_leaves(arm):
    motion = plan(arm, PICK, PLACE)
    grip, release = np.flatnonzero(motion.holding)[[0, -1]]
    assert motion.holding[grip : release + 1].all()
    assert motion.openings[grip - 1 : release + 1] == pytest.approx(CLOSED_M)
    assert motion.openings[release + 10 :] == pytest.approx(OPEN_M)
    assert motion.openings.min() >= CLOSED_M - 1e-9
    assert np.abs(np.diff(motion.openings)).max() <= 0.1 * FRAME_S * 2


def test_the_pull_takes_the_flying_pickers_time_and_its_ramps(arm):
    motion = plan(arm, PICK, PLACE)
    assert 0.5 < motion.holding.sum() * FRAME_S < 0.8 * motion.stretch
    assert motion.seconds < 7


def test_a_pull_to_the_same_point_holds_and_lets_go(arm):
    motion = plan(arm, PICK, PICK)
    assert motion.holding.sum() == 50
    np.testing.assert_allclose(motion.poses.points[motion.holding], np.broadcast_to(PICK, (50, 3)), atol=1e-6)


@pytest.mark.parametrize(
    ("pick", "place", "error", "reason"),
    [
        ([0.9, 0, 0.02], PLACE, OutOfReach, "^pick"),
        (PICK, [0.9, 0, 0.1], OutOfReach, "^place"),
        (PICK, [0.0, 0, 0.9], OutOfReach, "^place"),
        ([0, 0, -0.01], PLACE, OutOfReach, "^pick"),
        ([-0.4, -0.4, 0.1], [-0.4, 0.4, 0.1], OutOfReach, "from pick to place"),
        ([0.0, 0.0, 0.004], PLACE, Refused, "would collide: .*finger comes within .* of the table"),
        (PICK, [0.1, 0.0, 0.004], Refused, "would collide"),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_reason_and_the_arm_stands_still(arm, pick, place, error, reason):
    with pytest.raises(error, match=reason):
        plan(arm, np.array(pick), np.array(place))
    assert arm.joints == pytest.approx(PARKED, abs=1e-12)


def test_a_motion_that_would_run_into_the_arm_itself_is_seen(arm):
    folded = PARKED.copy()
    folded[3], folded[5] = LOWER[3], 3.7
    folded[1] = 1.7
    arm.move_to(folded)
    assert arm.touched() is not None


def test_from_where_a_stop_left_it_the_arm_first_rises(arm):
    first = plan(arm, PICK, PLACE)
    stopped = np.flatnonzero(first.holding)[20]
    arm.move_to(first.joints[stopped])
    here = first.poses.points[stopped]
    again = plan(arm, PICK, PLACE)
    low = again.poses.points[: np.argmax(again.poses.points[:, 2] >= OVER_M - 1e-6)]
    assert len(low) > 10
    np.testing.assert_allclose(low[:, :2], np.broadcast_to(here[:2], (len(low), 2)), atol=1e-6)
    np.testing.assert_allclose(again.joints[-1], PARKED, atol=1e-9)
