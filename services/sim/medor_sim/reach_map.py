"""What the arm can reach and pull, as a table: a thousand pulls are looked up in milliseconds."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from medor_sim.arm import Arm
from medor_sim.kinematics import UPPER, solve
from medor_sim.panda import hovering

RADII_M = np.arange(0.15, 0.951, 0.04)
HEIGHTS_M = np.r_[0.0, 0.0095, 0.0105, 0.0115, 0.0124, 0.015, 0.02, 0.06, 0.1:0.6:0.05]
"""Denser near the table, where it decides."""
MARGIN_RAD = 0.02
"""Kept from the joint limits at the nodes of the map."""
STATIONS = 16
"""Points of a straight way that are looked up."""


class ReachMap:
    """Where the tool may be, over (distance from the base axis, height).

    One half-plane is enough: a posture depends on the heading only by joint 1, and the table lies within its range. A
    point counts only if all four nodes around it do, so that the map is never too hopeful.
    """

    def __init__(self, arm: Arm) -> None:
        self._base = arm.base
        radius, height = np.meshgrid(RADII_M, HEIGHTS_M, indexing="ij")
        nodes = arm.base + np.stack([radius.ravel(), np.zeros(radius.size), height.ravel()], axis=1)
        postures = zip(*solve(nodes, arm.base, MARGIN_RAD), strict=True)
        clear = np.array([within and _clear(arm, joints) for joints, within in postures])
        self._clear = RegularGridInterpolator(
            (RADII_M, HEIGHTS_M), clear.reshape(radius.shape).astype(float), bounds_error=False, fill_value=0.0
        )
        arm.park()

    def reachable(self, points: NDArray) -> NDArray[np.bool_]:
        """(K,) bool: whether the joints allow the tool at points (K,3) [m] over the table; nothing else is asked."""
        return solve(points, self._base).within & (np.asarray(points)[:, 2] >= 0)

    def can_pull(self, picks: NDArray, places: NDArray) -> NDArray[np.bool_]:
        """(K,) bool: whether the arm can come down to picks (K,3) [m], go straight to places (K,3) and leave again.

        All the way within the joint limits, clear of the table and of itself.
        """
        stations = np.stack([hovering(picks), picks, places, hovering(places)])
        share = np.linspace(0, 1, STATIONS)[:, None, None, None]
        offset = stations[:-1] + share * np.diff(stations, axis=0) - self._base
        turned = np.abs(np.arctan2(offset[..., 1], offset[..., 0])) < UPPER[0] - MARGIN_RAD
        radius_height = np.stack([np.hypot(offset[..., 0], offset[..., 1]), offset[..., 2]], axis=-1)
        return (turned & (self._clear(radius_height) > 1 - 1e-6)).all(axis=(0, 1))


def _clear(arm: Arm, joints: NDArray[np.float64]) -> bool:
    arm.move_to(joints)
    return arm.touched() is None
