"""Turned and mirrored windows of stored views, and pixels to learn from in them.

Turning an image of the overhead camera about its middle turns the world about the camera's axis: depth and labels stay
what they are and only change places, so that depth, labels and world points agree (MEDOR, section 5.1).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from medor_recon.canonical.views import SIDE_PX, Views


@dataclass(frozen=True, eq=False)
class Placement:
    """How B windows lie in their views.

    Attributes:
        angle: (B,) float64 turn of the world about the camera's axis, counter-clockwise seen from above [rad].
        mirrored: (B,) bool, left and right of the world exchanged first.
        origin: (B, 2) float64 (u, v) of the window's corner in the turned image [px].
        scale: pixels of the image a pixel of the window.
        size: side of the windows [px].
    """

    angle: NDArray[np.float64]
    mirrored: NDArray[np.bool_]
    origin: NDArray[np.float64]
    scale: float
    size: int


def turned_centres(centre: NDArray, angle: NDArray, mirrored: NDArray) -> NDArray[np.float64]:
    """(B, 2) where points (u, v) of images come to lie."""
    u, v = (centre.astype(np.float64) - SIDE_PX / 2).T
    u = np.where(mirrored, -u, u)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * u + sin * v, cos * v - sin * u], -1) + SIDE_PX / 2


def windows(
    views: Views, rows: NDArray[np.int64], placement: Placement, chances: NDArray[np.float64]
) -> tuple[NDArray[np.uint16], NDArray[np.int32], NDArray[np.uint16]]:
    """Depth (B, size, size), pixels on the cloth (B, N, 2) as row and column, and their labels (B, N, 3).

    Nearest sampling; depth and labels as they are stored, those of mirrored garments mirrored.

    Args:
        views: to read from.
        rows: (B,) which views.
        placement: of the windows.
        chances: (B, N) in [0, 1), which pixels.
    """
    p = placement
    depth = np.zeros((len(rows), p.size, p.size), np.uint16)
    pixels = np.zeros((*chances.shape, 2), np.int32)
    labels = np.zeros((*chances.shape, 3), np.uint16)
    _fill(views.depth, views.nocs, views.start[rows], views.box[rows], p.angle, p.mirrored, p.origin, p.scale, chances,
          depth, pixels, labels)  # fmt: skip
    labels[p.mirrored, :, 0] = np.iinfo(np.uint16).max - labels[p.mirrored, :, 0]
    return depth, pixels, labels


@njit(nogil=True, cache=True)
def _fill(stored, nocs, start, box, angle, mirrored, origin, scale, chances, depth, pixels, labels):
    size, middle = depth.shape[1], SIDE_PX / 2
    sources = np.zeros(size * size, np.int64)
    places = np.zeros(size * size, np.int32)
    for b in range(len(start)):
        cos, sin, found = np.cos(angle[b]), np.sin(angle[b]), 0
        for i in range(size):
            for j in range(size):
                u = origin[b, 0] + (j + 0.5) * scale - middle
                v = origin[b, 1] + (i + 0.5) * scale - middle
                from_u, from_v = cos * u - sin * v, sin * u + cos * v
                if mirrored[b]:
                    from_u = -from_u
                row = int(np.floor(from_v + middle)) - box[b, 0]
                column = int(np.floor(from_u + middle)) - box[b, 1]
                if 0 <= row < box[b, 2] and 0 <= column < box[b, 3]:
                    source = start[b] + row * box[b, 3] + column
                    if stored[source] > 0:
                        depth[b, i, j] = stored[source]
                        sources[found], places[found] = source, i * size + j
                        found += 1
        for n in range(chances.shape[1]):
            k = int(chances[b, n] * found)
            pixels[b, n, 0], pixels[b, n, 1] = places[k] // size, places[k] % size
            for axis in range(3):
                labels[b, n, axis] = nocs[sources[k], axis]
