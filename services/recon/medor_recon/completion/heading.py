"""Which way a garment lies on the table, so that a network need not learn every way."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from medor_cloth.alignment import align_in_plane
from medor_cloth.nocs import NOCS
from medor_recon.completion.pixels import Pixels


def heading(pixels: Pixels) -> NDArray[np.float32]:
    """(3, 3) the turn about the vertical that brings the garment laid flat, front up, nearest to the visible points."""
    x, y, z = NOCS[pixels.category].decode(pixels.nocs).T
    in_plane, _ = align_in_plane(np.column_stack([x, z, -y]), pixels.points)
    R = np.eye(3, dtype=np.float32)
    R[:2, :2] = in_plane
    return R


def headed(pixels: Pixels, R: NDArray[np.float32]) -> Pixels:
    """A view as if the garment had been laid by R from here: points in the frame of the garment."""
    return replace(pixels, points=pixels.points @ R)
