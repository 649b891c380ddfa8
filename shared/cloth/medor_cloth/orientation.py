"""One winding for a whole surface."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from medor_cloth.errors import MeshError


def oriented(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Which faces (F,) to turn over so that all are wound alike and point outwards.

    Args:
        vertices: (V, 3).
        faces: (F, 3) of one connected manifold with at most two faces at an edge.

    Raises:
        MeshError: the surface has one side only, like a Möbius strip.
    """
    flip = _alike(faces, len(vertices))
    a, b, c = (vertices[faces[:, k]] - vertices.mean(axis=0) for k in range(3))
    volumes = (a * np.cross(b, c)).sum(axis=1) / 6
    return flip if np.where(flip, -volumes, volumes).sum() >= 0 else ~flip


def _alike(faces: NDArray, n_vertices: int) -> NDArray[np.bool_]:
    """Flips that make neighbours agree with the first face.

    Every face stands in the graph twice, as it is (i) and turned over (i + F); neighbours are joined in the states
    in which they agree. The component of the first face as it is holds every face in its right state.
    """
    n = len(faces)
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    owner = np.repeat(np.arange(n), 3)
    forward = directed[:, 0] < directed[:, 1]
    low, high = directed.min(axis=1), directed.max(axis=1)
    order = np.argsort(low * n_vertices + high, kind="stable")
    key = (low * n_vertices + high)[order]
    at = np.flatnonzero(key[1:] == key[:-1])
    one, other = order[at], order[at + 1]
    turned = np.where(forward[one] == forward[other], n, 0)  # both run the same way: one must be turned over
    rows = np.concatenate([owner[one], owner[one] + n])
    columns = np.concatenate([owner[other] + turned, owner[other] + n - turned])
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * n, 2 * n))
    label = connected_components(graph, directed=False)[1]
    if label[0] == label[n]:
        raise MeshError("the surface has only one side, like a Möbius strip; expected an inside and an outside")
    return label[:n] != label[0]
