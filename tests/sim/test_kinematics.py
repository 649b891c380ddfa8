"""Where the arm's joints put its tool, by formula and by PyBullet's body of the same arm."""

import numpy as np
import pytest
from pybullet import getMatrixFromQuaternion

from medor_sim.arm import HOME, PARKED, TOOL_LINK
from medor_sim.kinematics import LOWER, UPPER, forward, lean, solve

VIEW_M = 0.269
"""Half side of the table seen by the camera."""


def over_the_table(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform((-VIEW_M, -VIEW_M, 0), (VIEW_M, VIEW_M, 0.25), (count, 3))


def test_the_table_plane_is_zero_and_the_arm_stands_beside_the_view(world):
    hit = world._client.rayTest((0.1, -0.2, 2.0), (0.1, -0.2, -2.0))[0]
    assert hit[3][2] == pytest.approx(0, abs=1e-6)
    assert world.arm.base[0] < -VIEW_M
    assert not world.camera.contains(world.arm.tool)


def test_every_point_the_camera_sees_has_a_posture_within_the_limits_and_back_again(world):
    points = over_the_table(2000)
    postures = solve(points, world.arm.base)
    assert postures.within.all()
    np.testing.assert_allclose(forward(postures.joints, world.arm.base).points, points, atol=1e-12)


def test_formula_and_body_agree(world):
    points = over_the_table(60)
    joints = solve(points, world.arm.base).joints
    poses = forward(joints, world.arm.base)
    for k, point in enumerate(points):
        world.arm.move_to(joints[k])
        np.testing.assert_allclose(world.arm.tool, point, atol=1e-6)
        state = world._client.getLinkState(world.arm._body, TOOL_LINK, computeForwardKinematics=True)
        rotation = np.reshape(getMatrixFromQuaternion(state[5]), (3, 3))
        np.testing.assert_allclose(rotation, poses.rotations[k], atol=1e-6)
    world.arm.park()


def test_the_tool_points_down_and_leans_as_said(world):
    points = over_the_table(200)
    rotations = forward(solve(points, world.arm.base).joints, world.arm.base).rotations
    radius = np.hypot(*(points - world.arm.base)[:, :2].T)
    np.testing.assert_allclose(-rotations[:, 2, 2], np.cos(lean(radius)), atol=1e-9)
    np.testing.assert_allclose(rotations[:, 2, 1], 0, atol=1e-12)  # the fingers open level
    np.testing.assert_allclose(np.linalg.det(rotations), 1, atol=1e-9)


def test_a_turn_about_the_base_axis_turns_joint_one_only(world):
    straight, turned = np.array([[0.5, 0.0, 0.1]]), np.array([[0.5 * np.cos(0.7), 0.5 * np.sin(0.7), 0.1]])
    difference = (
        solve(turned + world.arm.base, world.arm.base).joints - solve(straight + world.arm.base, world.arm.base).joints
    )
    np.testing.assert_allclose(difference[0], [0.7, 0, 0, 0, 0, 0, 0], atol=1e-9)


def test_what_is_too_far_or_too_near_has_no_posture(world):
    away = world.arm.base + np.array([[1.2, 0, 0.1], [0.05, 0, 0.1], [0.5, 0, 1.5], [np.nan, 0, 0]])
    assert not solve(away, world.arm.base).within.any()


def test_a_margin_only_takes_away(world):
    points = np.random.default_rng(1).uniform((-0.6, -0.6, 0), (0.6, 0.6, 0.6), (3000, 3))
    free, careful = (solve(points, world.arm.base, margin).within for margin in (0.0, 0.1))
    assert (free | ~careful).all()
    assert careful.sum() < free.sum() < len(points)


def test_rest_postures_are_within_the_limits_and_out_of_the_way(world):
    assert (LOWER < HOME).all()
    assert (UPPER > HOME).all()
    world.arm.park()
    assert world.arm.joints == pytest.approx(PARKED)
    assert world.arm.touched() is None
