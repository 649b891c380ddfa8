"""What the arm says it can pull before it plans, against what it then plans."""

import time

import numpy as np
import pytest

from medor_sim.kinematics import solve
from medor_sim.panda import plan
from medor_sim.reach_map import ReachMap
from medor_wire.errors import MedorError

VIEW_M = 0.269
"""Half side of the table seen by the camera."""


@pytest.fixture(scope="module")
def reach(world):
    return ReachMap(world.arm)


def pulls(count: int, half: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Picks over cloth within a square, and places 5 to 20 cm away, as the planner proposes them."""
    rng = np.random.default_rng(seed)
    picks = rng.uniform((-half, -half, 0.0125), (half, half, 0.08), (count, 3))
    picks[::2, 2] = 0.0125  # a single layer on the table
    way = rng.uniform((-0.5, -0.5, 0), 0.5, (count, 3))
    places = picks + way * rng.uniform(0.05, 0.2, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    return picks.astype(np.float32), places.astype(np.float32)


def test_every_pull_the_camera_sees_can_be_done(world, reach):
    picks, places = pulls(3000, VIEW_M)
    seen = world.camera.contains(picks) & world.camera.contains(places)
    assert seen.sum() > 1000
    assert reach.can_pull(picks[seen], places[seen]).all()


def test_what_the_map_allows_is_never_refused_in_earnest(world, reach):
    """Far beyond the view too, where the arm comes to its ends."""
    picks, places = pulls(600, 0.5, seed=1)
    allowed = reach.can_pull(picks, places)
    assert 0.3 < allowed.mean() < 0.9
    for k in np.flatnonzero(allowed)[:10]:
        plan(world.arm, picks[k], places[k])


def test_the_map_is_not_too_careful(world, reach):
    picks, places = pulls(600, 0.5, seed=2)
    denied = np.flatnonzero(~reach.can_pull(picks, places))[:25]
    assert sum(_can_plan(world.arm, picks[k], places[k]) for k in denied) < 0.35 * len(denied)


def _can_plan(arm, pick, place) -> bool:
    try:
        plan(arm, pick, place)
    except MedorError:
        return False
    return True


def test_ends_in_reach_do_not_make_a_pull(world, reach):
    """From the one side of the foot to the other, through it."""
    pick, place = world.arm.base + np.array([[0.1, -0.4, 0.1], [0.1, 0.4, 0.1]])
    assert reach.reachable(np.stack([pick, place])).all()
    assert not reach.can_pull(pick[None], place[None]).any()


def test_points_and_joint_limits_agree(world, reach):
    points = np.random.default_rng(2).uniform((-0.7, -0.9, 0), (0.7, 0.9, 0.5), (2000, 3))
    np.testing.assert_array_equal(reach.reachable(points), solve(points, world.arm.base).within)
    assert 0.2 < reach.reachable(points).mean() < 0.9


@pytest.mark.parametrize("point", [(0, 0, -0.01), (0, 0, 0.9), (1.2, 0, 0.1), (-0.5, 0, 0.0), (np.nan, 0, 0)])
def test_absurd_points_are_out_of_reach(reach, point):
    fine = np.array([(0.0, 0.0, 0.1)])
    assert not reach.reachable(np.array([point])).any()
    assert not reach.can_pull(np.array([point]), fine).any()
    assert not reach.can_pull(fine, np.array([point])).any()


def test_a_thousand_pulls_cost_milliseconds(reach):
    picks, places = pulls(1000, VIEW_M)
    start = time.process_time()
    reach.can_pull(picks, places)
    assert time.process_time() - start < 0.05
