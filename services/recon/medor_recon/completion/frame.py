"""The frame of a garment on the table, so that a network need not learn every place and every way it may lie."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from medor_cloth.alignment import align_in_plane
from medor_cloth.nocs import NOCS
from medor_recon.completion.pixels import Pixels


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame on the table: z is up as in the world.

    Attributes:
        R: (3, 3) float32 and t: (3,) float32 [m], `p_world = R @ p_frame + t`.
    """

    R: NDArray[np.float32]
    t: NDArray[np.float32]

    def inward(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """World points (..., 3) in this frame."""
        return ((points - self.t) @ self.R).astype(np.float32)

    def outward(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Points (..., 3) of this frame in the world."""
        return (points @ self.R.T + self.t).astype(np.float32)

    def view(self, pixels: Pixels) -> Pixels:
        """A view with its points in this frame."""
        return replace(pixels, points=self.inward(pixels.points))


WORLD = Frame(np.eye(3, dtype=np.float32), np.zeros(3, np.float32))


def garment_frame(pixels: Pixels) -> Frame:
    """Where the garment laid flat, front up, comes nearest to the visible points; its origin is amid them."""
    in_plane, _ = align_in_plane(laid_flat(NOCS[pixels.category].decode(pixels.nocs)), pixels.points)
    R = np.eye(3, dtype=np.float32)
    R[:2, :2] = in_plane
    return Frame(R, np.append(pixels.points[:, :2].mean(axis=0), 0).astype(np.float32))


def laid_flat(canonical):
    """Canonical points (..., 3), of an array or a tensor, turned from upright to front up: (x, z, −y)."""
    flat = canonical[..., [0, 2, 1]]
    flat[..., 2] *= -1
    return flat
