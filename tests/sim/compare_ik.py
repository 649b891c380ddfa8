"""Which inverse kinematics: `python tests/sim/compare_ik.py` (needs `pip install pin`; no test).

The same tool poses, over all of the table that the camera sees and up to 0.25 m, solved by Pinocchio (damped least
squares), by PyBullet and by the arm's own formula, each from the same seed; judged by PyBullet's body of the arm.
"""

import importlib
import sys
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data

from medor_sim.arm import HOME, TOOL_LINK
from medor_sim.kinematics import LOWER, UPPER, Poses, forward, solve
from medor_sim.world import World

POSES = 500
REACHED_M, REACHED_RAD = 1e-3, 1e-2


def by_formula(points: np.ndarray, poses: Poses, seeds: np.ndarray, world: World) -> np.ndarray:
    return solve(points, world.arm.base).joints


def by_pinocchio(points: np.ndarray, poses: Poses, seeds: np.ndarray, world: World) -> np.ndarray:
    pin = importlib.import_module("pinocchio")
    whole = pin.buildModelFromUrdf(str(Path(pybullet_data.getDataPath()) / "franka_panda/panda.urdf"))
    fingers = [whole.getJointId(f"panda_finger_joint{n}") for n in (1, 2)]
    model = pin.buildReducedModel(whole, fingers, np.zeros(whole.nq))
    data, frame = model.createData(), model.getFrameId("panda_grasptarget")
    found = []
    for point, rotation, seed in zip(points - world.arm.base, poses.rotations, seeds, strict=True):
        goal, q = pin.SE3(rotation, point), seed.copy()
        for _ in range(200):
            pin.framesForwardKinematics(model, data, q)
            off = data.oMf[frame].actInv(goal)
            error = pin.log6(off).vector
            if np.linalg.norm(error) < 1e-6:
                break
            jacobian = -pin.Jlog6(off.inverse()) @ pin.computeFrameJacobian(model, data, q, frame)
            step = -jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-6 * np.eye(6), error)
            q = np.clip(pin.integrate(model, q, step), LOWER, UPPER)
        found.append(q)
    return np.array(found)


def by_pybullet(points: np.ndarray, poses: Poses, seeds: np.ndarray, world: World) -> np.ndarray:
    client, body = world._client, world.arm._body
    found = []
    for point, rotation, seed in zip(points, poses.rotations, seeds, strict=True):
        world.arm.move_to(seed)
        quaternion = pybullet.getQuaternionFromEuler(_euler(rotation))
        found.append(
            client.calculateInverseKinematics(
                body, TOOL_LINK, point.tolist(), quaternion, maxNumIterations=150, residualThreshold=1e-5
            )[:7]
        )
    return np.clip(found, LOWER, UPPER)


def _euler(rotation: np.ndarray) -> list[float]:
    pitch = -np.arcsin(np.clip(rotation[2, 0], -1, 1))
    return [np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])]


def main() -> None:
    points = np.random.default_rng(0).uniform((-0.269, -0.269, 0.0075), (0.269, 0.269, 0.25), (POSES, 3))
    ways: dict[str, Callable[..., np.ndarray]] = {
        "pin 4.1, damped least squares": by_pinocchio,
        "PyBullet, 150 iterations": by_pybullet,
        "formula": by_formula,
    }
    with closing(World()) as world:
        exact = solve(points, world.arm.base).joints
        poses = forward(exact, world.arm.base)
        seeds = np.tile(HOME, (POSES, 1))
        seeds[:, 0] = exact[:, 0]
        for name, way in ways.items():
            begun = time.process_time()
            joints = way(points, poses, seeds, world)
            ms = 1e3 * (time.process_time() - begun) / POSES
            metres, radians = np.transpose([_off(world, q, *pose) for q, *pose in zip(joints, *poses, strict=True)])
            reached = np.mean((metres < REACHED_M) & (radians < REACHED_RAD))
            sys.stdout.write(
                f"{name:30} {ms:.4f} ms, median {1e3 * np.median(metres):.4f} mm, worst {1e3 * metres.max():.4f} mm; "
                f"{reached:.1%} reached within 1 mm and 0.01 rad, joint limits kept\n"
            )


def _off(world: World, joints: np.ndarray, point: np.ndarray, rotation: np.ndarray) -> tuple[float, float]:
    world.arm.move_to(joints)
    quaternion = world._client.getLinkState(world.arm._body, TOOL_LINK, computeForwardKinematics=True)[5]
    there = np.reshape(pybullet.getMatrixFromQuaternion(quaternion), (3, 3))
    angle = np.arccos(np.clip((np.trace(there.T @ rotation) - 1) / 2, -1, 1))
    return float(np.linalg.norm(world.arm.tool - point)), float(angle)


if __name__ == "__main__":
    main()
