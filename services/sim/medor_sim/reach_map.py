"""Where the arm can put its tool point, as a table: a thousand points are looked up in well under a millisecond."""

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from medor_sim.arm import Arm

TOLERANCE_M = 0.005
"""A point counts as reached when the tool point comes this near."""
RADII_M = np.arange(0.05, 1.001, 0.05)
HEIGHTS_M = np.arange(0.0, 0.501, 0.05)


class ReachMap:
    """Distance the tool point stays short of a point, over (distance from the base axis, height).

    One half-plane is enough: the tool faces away from the base axis, so that only joint 1 depends on the heading, and
    the table lies within its range.
    """

    def __init__(self, arm: Arm) -> None:
        self._base = arm.base
        short = np.array([[_short_of(arm, r, z) for z in HEIGHTS_M] for r in RADII_M])
        self._short = RegularGridInterpolator((RADII_M, HEIGHTS_M), short, bounds_error=False, fill_value=np.inf)
        self._headings = arm.lower[0], arm.upper[0]
        arm.park()

    def reachable(self, points: np.ndarray) -> np.ndarray:
        """(K,) bool for points (K, 3) [m], world frame. Points below the table or off the map are not reachable."""
        offset = np.asarray(points, np.float64) - self._base
        heading = np.arctan2(offset[:, 1], offset[:, 0])
        radius_height = np.column_stack([np.hypot(offset[:, 0], offset[:, 1]), offset[:, 2]])
        turnable = (heading > self._headings[0]) & (heading < self._headings[1])
        return turnable & (self._short(radius_height) < TOLERANCE_M)


def _short_of(arm: Arm, radius: float, height: float) -> float:
    point = arm.base + (radius, 0.0, height)
    arm.face(point)
    return arm.reach_for(point)
