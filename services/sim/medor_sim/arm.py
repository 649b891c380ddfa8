"""The Panda arm, moved kinematically: it follows the flying picker and says how well it could."""

from typing import Any

import numpy as np

N_JOINTS = 7
TOOL_LINK = 11
"""The point between the finger tips."""
HOME = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.9, 0.785])
PARKED = np.array([np.pi / 2, *HOME[1:]])
"""Turned aside: between actions the arm is out of the camera's view."""
LEAN_RADIUS_M = (0.15, 0.40, 0.60, 0.85)
LEAN_RAD = (-0.6, 0.0, 0.0, 0.6)
"""The tool points straight down in the middle of the workspace and leans outwards far from the base and inwards near
it, as a person's hand does. A strictly vertical tool would reach only 0.26 to 0.79 m."""
ITERATIONS = 150


class Arm:
    """A Panda in a PyBullet world; `client` is used by one thread at a time.

    Args:
        client: PyBullet client the arm was loaded in.
        body: its body id there.
        base: (3,) position of its base [m], world frame; it faces +x.
    """

    def __init__(self, client: Any, body: int, base: tuple[float, float, float]) -> None:
        self._client, self._body = client, body
        self.base = np.array(base)
        limits = np.array([client.getJointInfo(body, joint)[8:10] for joint in range(N_JOINTS)])
        self.lower, self.upper = limits.T
        self.move_to(PARKED)

    @property
    def joints(self) -> np.ndarray:
        """(7,) joint angles [rad]."""
        return np.array([state[0] for state in self._client.getJointStates(self._body, range(N_JOINTS))])

    @property
    def tool(self) -> np.ndarray:
        """(3,) position of the tool point [m], world frame."""
        return np.array(self._client.getLinkState(self._body, TOOL_LINK, computeForwardKinematics=True)[4])

    def move_to(self, joints: np.ndarray) -> None:
        for joint, angle in enumerate(joints):
            self._client.resetJointState(self._body, joint, angle)

    def park(self) -> None:
        self.move_to(PARKED)

    def follow(self, path: np.ndarray) -> float:
        """Largest distance [m] of the tool point from a path (T, 3) [m] walked within the joint limits."""
        self.face(path[0])
        return max(self.reach_for(point) for point in path)

    def face(self, point: np.ndarray) -> None:
        """Home position, turned towards a point (3,) [m]."""
        self.move_to(np.array([self._heading(point), *HOME[1:]]))

    def reach_for(self, point: np.ndarray) -> float:
        """Move the tool point as near to a point (3,) [m] as the arm can from where it is; the distance left [m]."""
        solution = self._client.calculateInverseKinematics(
            self._body,
            TOOL_LINK,
            np.asarray(point, np.float64).tolist(),
            self._lean(point),
            maxNumIterations=ITERATIONS,
            residualThreshold=1e-5,
        )
        self.move_to(np.clip(solution[:N_JOINTS], self.lower, self.upper))
        return float(np.linalg.norm(self.tool - point))

    def _heading(self, point: np.ndarray) -> float:
        x, y = (np.asarray(point) - self.base)[:2]
        return float(np.arctan2(y, x))

    def _lean(self, point: np.ndarray) -> list[float]:
        """Quaternion (PyBullet's xyzw) of the tool at a point: down, turned to the point, leaning with distance."""
        lean = np.interp(np.linalg.norm((np.asarray(point) - self.base)[:2]), LEAN_RADIUS_M, LEAN_RAD)
        quaternion = self._client.getQuaternionFromEuler
        turn, tilt, down = (
            quaternion(angles) for angles in ((0, 0, self._heading(point)), (0, np.pi - lean, 0), (0, 0, np.pi))
        )
        origin = (0, 0, 0)
        leaning = self._client.multiplyTransforms(origin, tilt, origin, down)[1]
        return self._client.multiplyTransforms(origin, turn, origin, leaning)[1]
