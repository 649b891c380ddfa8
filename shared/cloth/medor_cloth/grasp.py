"""Which vertex a closing picker takes hold of."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medor_cloth.kernel import kernel

REACH_M = 0.02125
"""A closing picker grasps the nearest vertex within this distance [m] (MEDOR: threshold + picker + particle radius)."""


def grasp(positions: NDArray[np.float32], picker: ArrayLike) -> int:
    """The vertex a closing picker takes: the nearest within reach, -1 for none.

    Args:
        positions: (V,3) world frame [m].
        picker: Centre of the picker (3,) [m].
    """
    return int(nearest_within_reach(np.asarray(positions, np.float32), np.asarray(picker, np.float32)))


@kernel
def nearest_within_reach(x, picker):
    """Index of the vertex of (V,3) nearest to the picker (3,) if within `REACH_M`, else -1."""
    best, nearest = np.float32(REACH_M * REACH_M), -1
    for i in range(len(x)):
        dx, dy, dz = x[i, 0] - picker[0], x[i, 1] - picker[1], x[i, 2] - picker[2]
        square = dx * dx + dy * dy + dz * dz
        if square <= best:
            best, nearest = square, i
    return nearest
