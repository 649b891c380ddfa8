import time

import numpy as np
import pytest

from medor_cloth.picker import pull
from medor_sim.arm import HOME, PARKED
from medor_sim.reach_map import TOLERANCE_M, ReachMap

VIEW_M = 0.269
"""Half side of the table seen by the camera."""


@pytest.fixture(scope="module")
def reach(world):
    return ReachMap(world.arm)


def test_table_plane_is_zero_and_the_arm_stands_beside_the_view(world):
    hit = world._client.rayTest((0.1, -0.2, 2.0), (0.1, -0.2, -2.0))[0]
    assert hit[3][2] == pytest.approx(0, abs=1e-6)
    assert world.arm.base[0] < -VIEW_M
    assert not world.camera.contains(world.arm.tool)


def test_tool_arrives_where_it_is_sent(world):
    for point in np.array([[0, 0, 0.02], [0.26, 0.26, 0.05], [-0.26, -0.2, 0.2], [0.2, -0.26, 0.0]]):
        world.arm.face(point)
        assert world.arm.reach_for(point) < 1e-3
        assert np.linalg.norm(world.arm.tool - point) < 1e-3


def test_joints_stay_within_their_limits(world):
    rng = np.random.default_rng(0)
    for point in rng.uniform((-0.5, -0.9, 0), (0.9, 0.9, 0.5), (40, 3)):
        world.arm.face(point)
        world.arm.reach_for(point)
        assert (world.arm.joints >= world.arm.lower - 1e-9).all()
        assert (world.arm.joints <= world.arm.upper + 1e-9).all()


def test_arm_follows_a_pull_across_the_table_and_says_when_it_cannot(world):
    assert world.arm.follow(pull((-0.2, -0.2, 0.02), (0.2, 0.2, 0.2))) < 1e-3
    assert world.arm.follow(pull((0.2, 0.2, 0.02), (0.6, 0.6, 0.2))) > 0.1


def test_parked_arm_is_turned_aside(world):
    world.arm.park()
    assert world.arm.joints == pytest.approx(PARKED)
    assert abs(PARKED[0] - HOME[0]) > 1


def test_every_point_the_camera_sees_is_reachable(reach):
    rng = np.random.default_rng(1)
    seen = rng.uniform((-VIEW_M, -VIEW_M, 0), (VIEW_M, VIEW_M, 0.25), (1000, 3))
    assert reach.reachable(seen).all()


def test_the_map_agrees_with_the_arm_and_is_never_too_hopeful(world, reach):
    rng = np.random.default_rng(2)
    points = rng.uniform((-0.7, -0.9, 0), (0.7, 0.9, 0.5), (150, 3))
    said = reach.reachable(points)
    short = np.empty(len(points))
    for k, point in enumerate(points):
        world.arm.face(point)
        short[k] = world.arm.reach_for(point)
    assert short[said].max() < 2 * TOLERANCE_M
    assert (said == (short < TOLERANCE_M)).mean() > 0.9
    assert 0.2 < said.mean() < 0.9


@pytest.mark.parametrize("point", [(0, 0, -0.01), (0, 0, 0.6), (1.2, 0, 0.1), (-0.5, 0, 0.0), (np.nan, 0, 0)])
def test_absurd_points_are_out_of_reach(reach, point):
    assert not reach.reachable(np.array([point])).any()


def test_a_thousand_points_cost_milliseconds(reach):
    points = np.random.default_rng(3).uniform(-0.3, 0.3, (1000, 3))
    start = time.process_time()
    reach.reachable(points)
    assert time.process_time() - start < 0.02
