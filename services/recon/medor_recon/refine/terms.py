"""The terms of the finetuning loss: each gives its value and its gradient by the vertices, in closed form."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.kernel import kernel

CLEARANCE_M = 0.005
"""Least height of a vertex above the table [m]."""

Term = tuple[float, NDArray[np.float64]]
"""A term's value and its gradient (V, 3)."""


def chamfer(points: NDArray[np.float64], positions: NDArray[np.float64], visible: NDArray[np.integer]) -> Term:
    """Mean over points and axes of the squared difference to the nearest visible vertex [m²]; one way only.

    Args:
        points: (P, 3) observed, world frame [m].
        positions: (V, 3) world frame [m].
        visible: (n,) ids of the vertices seen, at least one.
    """
    owner, square = nearest(points, positions, visible)
    pull = (2 / points.size) * (positions[owner] - points)
    return float(square.sum() / points.size), _gathered(owner, pull, len(positions))


def consistency(positions: NDArray[np.float64], bound: NDArray[np.integer], targets: NDArray[np.float64]) -> Term:
    """Mean squared distance of the bound vertices (n,) to their targets (n, 3) [m²]; 0 when none is bound."""
    offset = positions[bound] - targets
    gradient = np.zeros_like(positions)
    gradient[bound] = 2 * offset / max(len(bound), 1)
    return float((offset**2).sum() / max(len(bound), 1)), gradient


def table(positions: NDArray[np.float64]) -> Term:
    """Mean squared depth of the vertices below the least height of cloth on a table [m²]."""
    below = np.maximum(CLEARANCE_M - positions[:, 2], 0)
    gradient = np.zeros_like(positions)
    gradient[:, 2] = -2 * below / len(below)
    return float((below**2).mean()), gradient


def stretch(positions: NDArray[np.float64], edges: NDArray[np.integer], rest_lengths: NDArray[np.float64]) -> Term:
    """Mean squared length of the edges (E, 2) in excess of their rest lengths (E,) [m²]: cloth folds, but holds."""
    first, second = edges.T
    side = positions[second] - positions[first]
    length = np.linalg.norm(side, axis=1)
    excess = np.maximum(length - rest_lengths, 0)
    pull = (2 / len(edges)) * (excess / np.maximum(length, 1e-12))[:, None] * side
    gradient = _gathered(second, pull, len(positions)) - _gathered(first, pull, len(positions))
    return float((excess**2).mean()), gradient


def nearest(
    points: NDArray[np.float64], positions: NDArray[np.float64], visible: NDArray[np.integer]
) -> tuple[NDArray[np.integer], NDArray[np.float64]]:
    """The nearest visible vertex of every point (P,) and its squared distance [m²]."""
    by_x = visible[np.argsort(positions[visible, 0], kind="stable")]
    row, square = _nearest(np.ascontiguousarray(points), positions[by_x])
    return by_x[row], square


@kernel
def _nearest(points, candidates):
    """For points (P, 3) the row of the nearest candidate (n, 3) and its squared distance; candidates ascend in x.

    From where a point would stand among them the search walks both ways until x alone is too far.
    """
    rows, squares = np.empty(len(points), np.int64), np.empty(len(points))
    xs = candidates[:, 0].copy()
    for p in range(len(points)):
        x, y, z = points[p]
        right = np.searchsorted(xs, x)
        left = right - 1
        best, row = 1e30, 0
        while left >= 0 or right < len(xs):
            if right >= len(xs) or (left >= 0 and x - xs[left] < xs[right] - x):
                c = left
                left -= 1
            else:
                c = right
                right += 1
            dx = xs[c] - x
            if dx * dx >= best:
                break
            dy, dz = candidates[c, 1] - y, candidates[c, 2] - z
            square = dx * dx + dy * dy + dz * dz
            if square < best:
                best, row = square, c
        rows[p], squares[p] = row, best
    return rows, squares


@kernel
def _gathered(rows, values, count):
    """(count, 3) sums of the values (n, 3) that go to each row."""
    sums = np.zeros((count, 3))
    for k in range(len(rows)):
        for axis in range(3):
            sums[rows[k], axis] += values[k, axis]
    return sums
