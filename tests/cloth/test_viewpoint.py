import numpy as np
import pytest

from medor_cloth.camera import overhead
from medor_cloth.viewpoint import above, around, turns

POINTS = np.random.default_rng(0).uniform((-0.1, -0.2, 0), (0.2, 0.2, 0.3), (200, 3))


@pytest.mark.parametrize("scale", [0.1, 1, 20])
@pytest.mark.parametrize("elevation", [5, 38, 90])
def test_a_view_from_the_side_just_holds_everything(scale, elevation):
    camera = around(scale * POINTS, 100, elevation)
    uv, depth = camera.project(scale * POINTS)
    assert camera.contains(scale * POINTS).all()
    assert (depth > 0).all()
    assert np.abs(uv - 50).max() > 40


def test_up_is_up_and_the_front_is_in_front():
    camera = around(POINTS, 100)
    low, high, near, far = camera.project(np.array([[0, 0, 0], [0, 0, 0.2], [0, -0.2, 0], [0, 0.2, 0]]))[0]
    assert high[1] < low[1]
    assert near[1] > far[1]
    assert camera.position[1] < 0 < camera.position[2]


def test_the_cells_camera_is_used_as_long_as_it_sees_the_cloth():
    np.testing.assert_array_equal(above(POINTS * (1, 1, 0.1), 64).T_world_camera, overhead(64).T_world_camera)
    away = POINTS + (1, 0, 0)
    moved = above(away, 64)
    assert moved.contains(away).all()
    np.testing.assert_array_equal(moved.T_world_camera[:3, :3], overhead(64).T_world_camera[:3, :3])


def test_a_turn_keeps_its_distance_and_sees_everything():
    cameras = turns(POINTS, 80, 12, 20.0)
    middle = (POINTS.max(0) + POINTS.min(0)) / 2
    distances = [np.linalg.norm(camera.position - middle) for camera in cameras]
    assert np.ptp(distances) < 0.02 * max(distances)
    assert all(camera.contains(POINTS).all() for camera in cameras)
