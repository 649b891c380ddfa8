"""The Panda's body in the PyBullet world: moved kinematically, asked what it would touch."""

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from medor_sim.kinematics import ACROSS, N_JOINTS

FINGERS = (9, 10)
TOOL_LINK = 11
"""The point between the finger tips."""
HOME = np.array([0.0, -0.4, 0.0, -2.2, 0.0, 1.9, ACROSS])
PARKED = np.array([np.pi / 2, *HOME[1:]])
"""Turned aside: between actions the arm is out of the camera's view."""
OPEN_M = 0.02
"""Half of the gap between open fingers."""
TABLE_CLEARANCE_M = 0.001
"""Kept between the arm and the table."""
SELF_CLEARANCE_M = 0.01
"""Kept between parts of the arm that no joint connects."""


class Arm:
    """A Panda in a PyBullet world; `client` is used by one thread at a time.

    Args:
        client: PyBullet client the arm was loaded in.
        body: its body id there.
        table: body id of what it must not touch.
        base: (3,) position of its base [m], world frame; it faces +x.
    """

    def __init__(self, client: Any, body: int, table: int, base: tuple[float, float, float]) -> None:
        self._client, self._body, self._table = client, body, table
        self.base = np.array(base)
        links = [client.getJointInfo(body, joint) for joint in range(client.getNumJoints(body))]
        self._names = {-1: "base"} | {k: link[12].decode().removeprefix("panda_") for k, link in enumerate(links)}
        solid = {-1} | {k for k in range(len(links)) if client.getCollisionShapeData(body, k)}
        apart = set(combinations(sorted(solid), 2)) - _connected([link[16] for link in links], solid) - {FINGERS}
        self._apart = sorted(apart)
        self.park()

    @property
    def joints(self) -> NDArray[np.float64]:
        """(7,) joint angles [rad]."""
        return np.array([state[0] for state in self._client.getJointStates(self._body, range(N_JOINTS))])

    @property
    def tool(self) -> NDArray[np.float64]:
        """(3,) position of the tool point [m], world frame."""
        return np.array(self._client.getLinkState(self._body, TOOL_LINK, computeForwardKinematics=True)[4])

    def move_to(self, joints: NDArray[np.float64], opening: float = OPEN_M) -> None:
        """Take a posture (7,) [rad], each finger so far from the middle [m]."""
        for joint, angle in enumerate(joints):
            self._client.resetJointState(self._body, joint, angle)
        for finger in FINGERS:
            self._client.resetJointState(self._body, finger, opening)

    def park(self) -> None:
        self.move_to(PARKED)

    def touched(self) -> str | None:
        """What the arm, as it stands, is too near to; None when it is clear of the table and of itself."""
        for contact in self._client.getClosestPoints(self._body, self._table, TABLE_CLEARANCE_M):
            return f"{self._names[contact[3]]} comes within {1e3 * contact[8]:.1f} mm of the table"
        for one, other in self._apart:
            for contact in self._client.getClosestPoints(self._body, self._body, SELF_CLEARANCE_M, one, other):
                return f"{self._names[one]} comes within {1e3 * contact[8]:.1f} mm of {self._names[other]}"
        return None


def _connected(parents: list[int], solid: set[int]) -> set[tuple[int, int]]:
    """Pairs (parent, child) of solid links with nothing solid between them."""
    pairs = set()
    for link in solid - {-1}:
        above = parents[link]
        while above not in solid:
            above = parents[above]
        pairs.add((above, link))
    return pairs
