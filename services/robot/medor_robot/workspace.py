"""What a motion of the real cell must keep within. Limits raise; they never clip in silence."""

from dataclasses import dataclass

import numpy as np

from medor_cloth.integration import FRAME_S
from medor_cloth.picker import PULL_FRAMES
from medor_wire.errors import BadRequest, OutOfReach

PULL_S = PULL_FRAMES * FRAME_S
"""A pull takes this long, whatever its length [s]."""


@dataclass(frozen=True)
class Workspace:
    """A box over the table and a speed.

    Args:
        half_side: of the square on the table, around the origin [m].
        highest: the tool goes [m].
        lowest: the tool goes; below it the fingers would press on the table [m].
        top_speed: of the tool [m/s].
    """

    half_side: float = 0.30
    highest: float = 0.40
    lowest: float = 0.002
    top_speed: float = 0.5

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(K,) bool for points (K, 3) [m], world frame."""
        x, y, z = np.asarray(points, np.float64).T
        on_table = (np.abs(x) <= self.half_side) & (np.abs(y) <= self.half_side)
        return on_table & (z >= self.lowest) & (z <= self.highest)

    def check(self, pick: np.ndarray, place: np.ndarray) -> None:
        """Raises when a pull must not be tried.

        Raises:
            OutOfReach: pick or place lies outside the box.
            BadRequest: the pull would be too fast.
        """
        for name, point in (("pick", pick), ("place", place)):
            if not self.contains(point[None])[0]:
                raise OutOfReach(
                    f"{name}: expected |x|, |y| <= {self.half_side} m and {self.lowest} <= z <= {self.highest} m, "
                    f"got {point.round(4).tolist()}"
                )
        speed = float(np.linalg.norm(place - pick)) / PULL_S
        if speed > self.top_speed:
            raise BadRequest(f"expected a pull of at most {self.top_speed} m/s, got {speed:.2f} m/s ({PULL_S} s long)")
