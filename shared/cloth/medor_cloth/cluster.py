"""Coarse meshes whose vertices are vertices of the fine mesh (MEDOR, section IV: the dynamics graph)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

VOXEL_M = 0.025


@dataclass(frozen=True, eq=False)
class Clustered:
    """A coarse mesh in terms of a fine one.

    Attributes:
        ids: (n,) int32 fine vertex of every coarse vertex, unique; coarse positions at any time are
            `positions[ids]`.
        faces: (m, 3) int32 into `ids`, three different corners each, winding kept, no face twice.
        edges: (e, 2) int32 into `ids`, undirected and unique, first < second. Holds the edges of `faces` and
            those of fine faces that collapsed to a line, so a connected mesh stays connected.
    """

    ids: np.ndarray
    faces: np.ndarray
    edges: np.ndarray


def cluster(vertices: np.ndarray, faces: np.ndarray, voxel: float = VOXEL_M) -> Clustered:
    """Merge the vertices that share a voxel; the one nearest to their average stands for them.

    Args:
        vertices: (V, 3) canonical space [m]; the garment's layers lie apart there and are not merged.
        faces: (F, 3) int.
        voxel: side of a voxel [m].
    """
    vertices = np.asarray(vertices, np.float64)
    voxels = np.floor(vertices / voxel).astype(np.int64)
    _, member_of = np.unique(voxels, axis=0, return_inverse=True)
    member_of = member_of.ravel()
    collapsed = member_of[np.asarray(faces)]
    return Clustered(
        ids=_nearest_to_average(vertices, member_of).astype(np.int32),
        faces=_proper_faces(collapsed).astype(np.int32),
        edges=_unique_edges(collapsed).astype(np.int32),
    )


def _nearest_to_average(vertices: np.ndarray, member_of: np.ndarray) -> np.ndarray:
    sizes = np.bincount(member_of)
    average = np.stack([np.bincount(member_of, axis) / sizes for axis in vertices.T], axis=1)
    distance = np.linalg.norm(vertices - average[member_of], axis=1)
    order = np.lexsort((distance, member_of))
    first_of_cluster = np.cumsum(sizes) - sizes
    return order[first_of_cluster]


def _proper_faces(faces: np.ndarray) -> np.ndarray:
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return faces[np.sort(first)]


def _unique_edges(faces: np.ndarray) -> np.ndarray:
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)
