"""Fingers push what they meet, and nothing else."""

import numpy as np
import pytest

from medor_cloth.cloth import Cloth
from medor_cloth.solver import ClothState, Solver
from medor_sim.fingers import FINGER_HALF_M, LAYER_M, Fingers
from medor_sim.kinematics import Poses

DOWN = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
OPEN = 0.02


def hand(*points, opening=OPEN) -> Fingers:
    """An upright hand whose tool passes these points, one a frame."""
    tool = np.array(points, np.float64)
    return Fingers(Poses(tool, np.broadcast_to(DOWN, (len(tool), 3, 3))), np.broadcast_to(opening, len(tool)))


def cloud(count: int = 4000, seed: int = 0) -> ClothState:
    """Points all over a volume that holds the fingers; no cloth need be that dense."""
    points = np.random.default_rng(seed).uniform((-0.05, -0.06, LAYER_M), (0.05, 0.06, 0.06), (count, 3))
    return state(points)


def state(points) -> ClothState:
    x = np.asarray(points, np.float32)
    return ClothState(x, np.zeros_like(x), -1, np.zeros(3, np.float32), 0, 0)


def deepest(fingers: Fingers, frame: int, positions: np.ndarray) -> float:
    """How far the deepest point is inside [m]; negative: how far the nearest is away."""
    return max(
        float((box.half + LAYER_M - np.abs((positions - box.centre) @ box.axes)).min(axis=1).max())
        for box in fingers.boxes(frame)
    )


def test_nothing_is_left_inside_and_what_is_outside_stays():
    fingers, before = hand((0, 0, 0.03)), cloud()
    assert fingers.touch(0, before.positions)
    after = fingers.push(0, before)
    assert deepest(fingers, 0, before.positions) > 0.005
    assert deepest(fingers, 0, after.positions) < 1e-6
    moved = np.linalg.norm(after.positions - before.positions, axis=1)
    box = np.abs(np.abs(before.positions) - [0, OPEN + FINGER_HALF_M[1], 0])[:, :2] < FINGER_HALF_M[:2] + LAYER_M
    assert 0.02 < (moved > 0).mean() < 0.5
    assert not moved[~box.all(axis=1)].any()
    assert moved.max() <= 2 * FINGER_HALF_M[1]


def test_a_hand_in_the_air_touches_nothing():
    fingers, before = hand((0, 0, 0.12)), cloud()
    assert not fingers.touch(0, before.positions)
    assert fingers.push(0, before) is before


def test_the_gap_between_open_fingers_is_free_and_closing_gathers_what_is_near():
    y = np.array([[0, 0.019, 0.03], [0, -0.018, 0.03], [0, 0, 0.03]])
    assert not hand((0, 0, 0.03), opening=0.025).touch(0, y)
    closing = np.linspace(0.025, 0.005, 11)
    fingers = Fingers(Poses(np.broadcast_to([0, 0, 0.03], (11, 3)), np.broadcast_to(DOWN, (11, 3, 3))), closing)
    cloth = state(y)
    for frame in range(11):
        cloth = fingers.push(frame, cloth)
    np.testing.assert_allclose(cloth.positions[:, 1], [0.0025, -0.0025, 0], atol=1e-6)
    assert cloth.velocities[0, 1] < 0 < cloth.velocities[1, 1]


def test_a_held_vertex_is_left_between_the_fingers():
    before = state([[0, OPEN + 0.005, 0.03], [0.001, OPEN + 0.005, 0.03]])
    before.held = 0
    after = hand((0, 0, 0.03)).push(0, before)
    assert (after.positions[0] == before.positions[0]).all()
    assert (after.positions[1] != before.positions[1]).any()


def test_coming_down_presses_cloth_no_further_than_onto_the_table():
    fingers = hand((0, 0, 0.02), (0, 0, 0.015), (0, 0, 0.0105))
    cloth = state([[0, OPEN + 0.007, 0.011]])
    for frame in range(3):
        cloth = fingers.push(frame, cloth)
    np.testing.assert_allclose(cloth.positions[0], [0, OPEN + 0.007, LAYER_M], atol=1e-6)


def test_a_sheet_gives_way_to_a_finger_that_comes_from_the_side():
    """The finger sweeps a hanging edge along; the sheet does not come through."""
    x, y = np.meshgrid(np.linspace(0, 0.1, 9), np.linspace(-0.05, 0.05, 9), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.full(81, 0.03)], axis=1)
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate([np.c_[corner, corner + 9, corner + 1], np.c_[corner + 1, corner + 9, corner + 10]])
    solver = Solver(Cloth.from_mesh(points.astype(np.float32), faces.astype(np.int32)))
    cloth = solver.rest(points)
    fingers = hand(*[(0.08 - 0.003 * k, 0, 0.02) for k in range(10)])
    before = cloth.positions.mean(axis=0)
    for frame in range(10):
        cloth = fingers.push(frame, solver.advance(cloth, 1))
        assert deepest(fingers, frame, cloth.positions) < 1e-6
    assert cloth.positions.mean(axis=0)[2] < before[2]
    assert np.isfinite(cloth.positions).all()
    assert np.abs(cloth.velocities).max() < 3


@pytest.mark.parametrize("axis", [0, 1])
def test_push_is_mirror_symmetric(axis):
    mirror = np.ones(3, np.float32)
    mirror[axis] = -1
    fingers, cloth = hand((0, 0, 0.03)), cloud(500)
    one = fingers.push(0, cloth).positions * mirror
    other = fingers.push(0, state(cloth.positions * mirror)).positions
    np.testing.assert_allclose(one, other, atol=1e-7)
