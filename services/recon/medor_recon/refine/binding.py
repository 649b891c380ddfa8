"""Which vertices are bound to which observed points: those that share a canonical coordinate."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

CELLS = 64
"""Cells along each side of the NOCS cube, as many as the canonicalisation network has bins."""


class Binding(NamedTuple):
    """Vertices and where the view says that they are."""

    vertices: NDArray[np.int64]
    """(n,) ids."""
    targets: NDArray[np.float64]
    """(n, 3) world frame [m]."""


def bind(
    vertices: NDArray[np.floating], nocs: NDArray[np.floating], points: NDArray[np.floating], reach: float
) -> Binding:
    """Every vertex to the mean of the points observed in the nearest cell that has any (MEDOR, consistency loss).

    Args:
        vertices: (V, 3) in the NOCS cube.
        nocs: (P, 3) predicted canonical coordinates of the observed points.
        points: (P, 3) observed, world frame [m].
        reach: a vertex whose nearest such cell's centre is farther than this stays free; in the NOCS cube.
    """
    cells = np.clip(np.asarray(nocs, np.float64) * CELLS, 0, CELLS - 1).astype(np.int64)
    occupied, cell_of, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(cell_of.ravel(), axis) for axis in np.asarray(points, np.float64).T], axis=1)
    means = sums / count[:, None]
    distance, cell = KDTree((occupied + 0.5) / CELLS).query(vertices)
    bound = np.flatnonzero(np.asarray(distance) < reach)
    return Binding(bound, means[np.asarray(cell)[bound]])
