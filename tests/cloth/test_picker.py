import numpy as np
import pytest

from medor_cloth.grasp import REACH_M, grasp
from medor_cloth.picker import PULL_FRAMES, SETTLE_FRAMES, pick_place, pull
from medor_cloth.solver import ClothState, Solver
from tests.cloth.sheets import EDGE_M, sheet, solver_of


@pytest.fixture(scope="module")
def laid() -> tuple[Solver, ClothState]:
    """A sheet at rest on the table."""
    vertices, faces = sheet(8, 8)
    solver = solver_of(vertices, faces)
    return solver, solver.advance(solver.rest(vertices + [0, 0, 0.0025]), 30, settle_speed=0.02)


def test_the_nearest_vertex_within_reach_is_grasped_and_none_beyond():
    positions = np.array([[0, 0, 0], [0.01, 0, 0], [0.5, 0, 0]], np.float32)
    assert grasp(positions, [0.008, 0, 0]) == 1
    assert grasp(positions, [0.003, 0, 0.01]) == 0
    assert grasp(positions, [0.5, 0, REACH_M - 1e-5]) == 2
    assert grasp(positions, [0.5, 0, REACH_M + 1e-5]) == -1


def test_the_pull_is_straight_and_even():
    path = pull([0.1, 0, 0.01], [0.1, 0.1, 0.06])
    assert len(path) == PULL_FRAMES
    np.testing.assert_allclose(path[-1], [0.1, 0.1, 0.06], atol=1e-7)
    np.testing.assert_allclose(np.diff(path, axis=0), np.tile([0, 0.002, 0.001], (PULL_FRAMES - 1, 1)), atol=1e-6)


def test_only_the_grasped_vertex_goes_exactly_the_way_of_the_picker(laid):
    solver, state = laid
    pick = state.positions[0] + [0.001, 0, 0.01]
    way = np.array([0.05, 0.03, 0.04])
    frames = pick_place(solver, state, pick, pick + way, record_every=1).frames
    moved = frames[PULL_FRAMES - 1] - state.positions
    exact = np.linalg.norm(moved - way, axis=1) < 1e-6
    assert exact.nonzero()[0].tolist() == [0]
    np.testing.assert_allclose(frames[24, 0] - state.positions[0], way / 2, atol=1e-6)


def test_a_released_vertex_falls(laid):
    solver, state = laid
    pick = state.positions[0]
    outcome = pick_place(solver, state, pick, pick + [0.03, 0.03, 0.08])
    assert outcome.grasped
    assert outcome.state.held == -1
    assert outcome.state.positions[0, 2] < 0.03


def test_a_pick_at_nothing_grasps_nothing_and_leaves_the_cloth(laid):
    solver, state = laid
    outcome = pick_place(solver, state, [0.5, 0.5, 0.01], [0, 0, 0.1])
    assert not outcome.grasped
    np.testing.assert_allclose(outcome.state.positions, state.positions, atol=EDGE_M / 50)


def test_recording_changes_nothing_and_ends_with_the_last_state(laid):
    solver, state = laid
    pick, place = state.positions[0], state.positions[0] + [0.05, 0.05, 0.02]
    plain, recorded = pick_place(solver, state, pick, place), pick_place(solver, state, pick, place, record_every=10)
    assert plain.frames.shape == (0, 81, 3)
    assert PULL_FRAMES // 10 < len(recorded.frames) <= (PULL_FRAMES + SETTLE_FRAMES) // 10
    np.testing.assert_array_equal(recorded.frames[-1], plain.state.positions)
