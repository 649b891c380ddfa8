"""The coarse mesh a model moves, and what it means for the mesh it was made of (MEDOR, section IV-B)."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_cloth.cluster import Clustered, cluster
from medor_dynamics.graphs import Graphs
from medor_dynamics.preset import Preset
from medor_wire.messages import ClothMesh

BLENDED = 3
"""Nodes whose motion a vertex follows."""


@dataclass(frozen=True, eq=False)
class NodeMesh:
    """Nodes of a fine mesh of V vertices.

    Attributes:
        ids: (n,) vertex of each node.
        edges: (e, 2) undirected, of nodes.
        faces: (m, 3) of nodes; none for recorded data, which has no use for them.
        rest_shape: (V, 3) the garment as it is worn, where its layers lie apart [m].
        neighbors: (V, 3) nodes next to each vertex in the rest shape, nearest first.
        weights: (V, 3) float32 share of each neighbor in the vertex's motion; adds up to 1.
    """

    ids: NDArray[np.int32]
    edges: NDArray[np.int32]
    faces: NDArray[np.int32]
    rest_shape: NDArray[np.float32]
    neighbors: NDArray[np.int64]
    weights: NDArray[np.float32]

    @classmethod
    def of(cls, mesh: ClothMesh) -> Self:
        """Clusters a mesh as it is worn; a mesh that does not know its worn shape is clustered as it lies."""
        rest_shape = mesh.vertices if mesh.canonical is None else mesh.canonical
        return cls.over(rest_shape, cluster(rest_shape, mesh.faces))

    @classmethod
    def over(cls, rest_shape: NDArray[np.float32], nodes: Clustered) -> Self:
        ids = nodes.ids
        nearest = min(BLENDED, len(ids))
        distance, neighbors = KDTree(rest_shape[ids]).query(rest_shape, k=nearest)
        distance, neighbors = np.reshape(distance, (-1, nearest)), np.reshape(neighbors, (-1, nearest))
        weights = 1 / np.maximum(distance, 1e-6) ** 2
        weights /= weights.sum(axis=1, keepdims=True)
        return cls(ids, nodes.edges, nodes.faces, rest_shape, neighbors.astype(np.int64), weights.astype(np.float32))

    def node_of(self, vertex: int) -> int:
        """The node that stands for a vertex: the nearest in the rest shape, so never one of another layer."""
        return int(self.neighbors[vertex, 0])

    def rest_lengths(self, positions: NDArray[np.float32], preset: Preset) -> NDArray[np.float32]:
        """(e,) rest lengths [m] for nodes that lie at positions (n, 3) before the action (MEDOR's convention)."""
        shape = positions if preset.rest == "start" else self.rest_shape[self.ids]
        return np.linalg.norm(shape[self.edges[:, 0]] - shape[self.edges[:, 1]], axis=1).astype(np.float32)

    def graphs(self, positions: NDArray[np.float32], preset: Preset) -> Graphs:
        """One graph whose nodes lie at positions (n, 3) before the action."""
        return Graphs.of([len(self.ids)], [self.edges], [self.rest_lengths(positions, preset)])

    def follow(self, vertices: NDArray[np.float32], nodes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Vertices (V, 3) carried along by nodes that have moved to (K, n, 3): (K, V, 3) [m]."""
        moved = nodes - vertices[self.ids]
        return vertices + np.einsum("vb,kvbi->kvi", self.weights, moved[:, self.neighbors], optimize=True)
