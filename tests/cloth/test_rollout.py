import numpy as np
import pytest

from medor_cloth.errors import ClothError
from medor_cloth.picker import pick_place
from medor_cloth.rollout import Cancelled, rollouts
from tests.cloth.sheets import sheet, solver_of


@pytest.fixture(scope="module")
def task():
    """A solver, a state at rest and six candidates."""
    vertices, faces = sheet(8, 8)
    solver = solver_of(vertices, faces)
    state = solver.rest(vertices + [0, 0, 0.0025])
    rng = np.random.default_rng(0)
    picks = state.positions[rng.integers(len(vertices), size=6)] + np.array([0, 0, 0.01], np.float32)
    return solver, state, picks, picks + rng.uniform([-0.1, -0.1, 0], 0.1, (6, 3)).astype(np.float32)


@pytest.mark.parametrize("threads", [1, 3])
def test_rollouts_equal_one_pick_and_place_after_the_other_whatever_the_threads(task, threads: int):
    solver, state, picks, places = task
    together = rollouts(solver, state, picks, places, threads=threads)
    alone = [pick_place(solver, state, *pair).state.positions for pair in zip(picks, places, strict=True)]
    np.testing.assert_array_equal(together, np.stack(alone))


def test_positions_alone_mean_a_cloth_at_rest(task):
    solver, state, picks, places = task
    np.testing.assert_array_equal(
        rollouts(solver, state.positions, picks[:2], places[:2]), rollouts(solver, state, picks[:2], places[:2])
    )


def test_every_finished_rollout_is_told(task):
    solver, state, picks, places = task
    told: list[int] = []
    rollouts(solver, state, picks, places, threads=2, on_done=told.append)
    assert told == [1, 2, 3, 4, 5, 6]


def test_cancelling_stops_before_the_next_rollout(task):
    solver, state, picks, places = task
    told: list[int] = []
    with pytest.raises(Cancelled, match="2 of 6"):
        rollouts(solver, state, picks, places, threads=1, cancelled=lambda: len(told) >= 2, on_done=told.append)
    assert told == [1, 2]


def test_no_candidates_are_no_rollouts(task):
    solver, state, _, _ = task
    assert rollouts(solver, state, np.empty((0, 3)), np.empty((0, 3))).shape == (0, 81, 3)


def test_picks_without_places_are_refused(task):
    solver, state, picks, places = task
    with pytest.raises(ClothError, match="picks and places"):
        rollouts(solver, state, picks, places[:-1])
