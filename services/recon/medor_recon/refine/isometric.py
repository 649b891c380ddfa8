"""A first layout of the mesh that keeps its lengths: as rigid as possible (Sorkine & Alexa 2007), drawn to the points
that share its canonical coordinates.

Completion gives every vertex the mean of where it may be. Means lie too close together: edges come out a third too
short, layers run through each other. Cloth hardly stretches, so of all layouts near these means the one is wanted whose
neighbourhoods are turned, not deformed.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import splu

from medor_recon.refine.binding import Binding
from medor_recon.refine.config import Isometry
from medor_recon.refine.terms import CLEARANCE_M

FREE = 1e-6
"""Weight that keeps vertices without a point, in a part of the mesh without any, where they are."""


def lay_out(
    positions: NDArray[np.floating],
    canonical: NDArray[np.floating],
    edges: NDArray[np.integer],
    binding: Binding,
    config: Isometry,
) -> NDArray[np.float64]:
    """Vertices (V, 3) [m] whose neighbourhoods are those of canonical space, turned.

    Alternates between the best rotation of each neighbourhood and the best positions given the rotations. A point
    that stays far from its vertex counts ever less: its canonical coordinate is wrong.

    Args:
        positions: (V, 3) where the vertices are, world frame [m].
        canonical: (V, 3) canonical space [m].
        edges: (E, 2) undirected.
        binding: vertices and where the view says that they are.
        config: weights and iterations.
    """
    x = np.array(positions, np.float64)
    first, second = edges.T
    rest = (canonical[second] - canonical[first]).astype(np.float64)
    stiffness = config.weight * _laplacian(edges, len(x))
    for _ in range(config.iterations):
        rotations = _rotations(edges, rest, x)
        sides = np.einsum("ei,eij->ej", rest, (rotations[first] + rotations[second]) / 2)
        trust = np.full(len(x), FREE)
        distance = np.linalg.norm(x[binding.vertices] - binding.targets, axis=1)
        trust[binding.vertices] = (1 + (distance / config.doubt_m) ** 2) ** -2
        target = x.copy()
        target[binding.vertices] = binding.targets
        right = config.weight * (_summed(second, sides, len(x)) - _summed(first, sides, len(x)))
        x = splu(csc_matrix(stiffness + diags(trust))).solve(right + trust[:, None] * target)
        x[:, 2] = np.maximum(x[:, 2], CLEARANCE_M / 2)
    return x


def _rotations(edges: NDArray[np.integer], rest: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 3, 3) best rotation of each vertex's edges, for row vectors: rest @ rotation is nearest to what is."""
    first, second = edges.T
    outer = (rest[:, :, None] * (x[second] - x[first])[:, None, :]).reshape(-1, 9)
    spread = (_summed(first, outer, len(x)) + _summed(second, outer, len(x))).reshape(-1, 3, 3)
    left, _, right = np.linalg.svd(spread)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return left @ right


def _laplacian(edges: NDArray[np.integer], count: int) -> csc_matrix:
    """(V, V) graph Laplacian."""
    first, second = edges.T
    rows, columns = np.r_[first, second], np.r_[second, first]
    neighbours = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    return csc_matrix(diags(np.asarray(neighbours.sum(axis=1)).ravel()) - neighbours)


def _summed(rows: NDArray[np.integer], values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """(count, n) sums of the values (m, n) that go to each row."""
    sums = np.zeros((count, values.shape[1]))
    for column, into in zip(values.T, sums.T, strict=True):
        into[:] = np.bincount(rows, weights=column, minlength=count)
    return sums
