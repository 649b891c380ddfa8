"""Which pixels are garment: by the mask that came along, else by height above the table plane z = 0."""

import numpy as np
from scipy.ndimage import binary_opening

from medor_wire.errors import BadRequest, NoGarment

SPECKLE_PX = np.ones((3, 3), bool)
"""Blobs thinner than this are sensor noise: garments are never one pixel wide."""
PLAUSIBLE_M = (-0.05, 0.6)
"""Heights above the table that cloth seen by a calibrated camera can have."""


def segment(points: np.ndarray, mask: np.ndarray | None, min_height: float) -> np.ndarray:
    """(H, W) bool, true on the garment.

    Args:
        points: (H, W, 3) world points [m]; NaN where nothing was measured.
        mask: (H, W) bool given by the asker, or None.
        min_height: without a mask, what rises higher above the table [m] is garment.

    Raises:
        NoGarment: nothing was measured on the garment.
        BadRequest: the garment would float or lie far below the table.
    """
    height = points[..., 2]
    measured = np.isfinite(height)
    if mask is not None:
        garment = measured & mask
    else:
        garment = np.asarray(binary_opening(measured & (height > min_height), SPECKLE_PX), bool)
    if not garment.any():
        where = "inside the mask" if mask is not None else f"more than {min_height * 1e3:.0f} mm above the table"
        raise NoGarment(f"no measured pixel {where}")
    middle = float(np.median(height[garment]))
    if not PLAUSIBLE_M[0] < middle < PLAUSIBLE_M[1]:
        raise BadRequest(
            f"expected depth in metres and a camera pose above the table z = 0, got a garment at height {middle:.3f} m"
        )
    return garment
