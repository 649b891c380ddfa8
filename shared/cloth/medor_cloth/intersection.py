"""Where a triangle mesh runs through itself."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

PARALLEL = 1e-18
"""Determinants below this count as an edge parallel to the triangle [m³]."""


def self_intersections(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> int:
    """Number of pairs of faces without a common vertex that cross.

    Args:
        vertices: (V, 3) [m].
        faces: (F, 3).
    """
    corners = np.asarray(vertices, np.float64)[faces]
    first, second = _close_pairs(corners, np.asarray(faces)).T
    crossing = np.zeros(len(first), bool)
    for one, other in ((first, second), (second, first)):
        for k in range(3):
            crossing |= _pierces(corners[one, k], corners[one, (k + 1) % 3], corners[other])
    return int(crossing.sum())


def _close_pairs(corners: NDArray, faces: NDArray) -> NDArray:
    """(N, 2) pairs of faces whose bounding boxes overlap and that share no vertex."""
    centres = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centres[:, None], axis=2).max()
    pairs = KDTree(centres).query_pairs(2 * radius, output_type="ndarray")
    low, high = corners.min(axis=1), corners.max(axis=1)
    a, b = pairs.T
    pairs = pairs[((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)]
    shared = (faces[pairs[:, 0]][:, :, None] == faces[pairs[:, 1]][:, None, :]).any(axis=(1, 2))
    return pairs[~shared]


def _pierces(start: NDArray, end: NDArray, triangle: NDArray) -> NDArray[np.bool_]:
    """Which segments start–end (N, 3) pass through their triangle (N, 3, 3) (Möller & Trumbore 1997)."""
    side, other, along = triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0], end - start
    p = np.cross(along, other)
    det = (side * p).sum(axis=1)
    meets = np.abs(det) > PARALLEL
    det = np.where(meets, det, 1.0)
    offset = start - triangle[:, 0]
    q = np.cross(offset, side)
    u, v, t = ((x * y).sum(axis=1) / det for x, y in ((offset, p), (along, q), (other, q)))
    return meets & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)
