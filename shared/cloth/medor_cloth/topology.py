"""What a triangle mesh is as a surface: manifold or not, its rims, its Euler number."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


@dataclass(frozen=True)
class Topology:
    """Counts that tell cloth from broken meshes."""

    components: int
    """Connected pieces, counting only vertices in use."""
    boundary_loops: int
    """Closed rims: neck, cuffs, hems, …"""
    euler: int
    """Vertices − edges + faces; a sphere with `b` rims has 2 − b."""
    nonmanifold_edges: int
    """Edges of more than two faces."""
    pinched_vertices: int
    """Vertices through which more than one rim passes."""
    unused_vertices: int
    consistent_winding: bool
    """Whether the two faces at every inner edge run through it in opposite directions."""

    def is_sphere_with_holes(self, loops: int) -> bool:
        """Whether the mesh is one clean oriented sheet: a sphere with `loops` holes."""
        clean = self.nonmanifold_edges == self.pinched_vertices == self.unused_vertices == 0
        return (
            clean
            and self.consistent_winding
            and self.components == 1
            and self.boundary_loops == loops
            and self.euler == 2 - loops
        )


def topology(faces: NDArray[np.integer], n_vertices: int) -> Topology:
    """Topology of faces (F, 3) over `n_vertices` vertices."""
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    _, repeats = np.unique(directed[:, 0] * n_vertices + directed[:, 1], return_counts=True)
    ends = np.sort(directed, axis=1)
    key, faces_at = np.unique(ends[:, 0] * n_vertices + ends[:, 1], return_counts=True)
    edges = np.column_stack([key // n_vertices, key % n_vertices])
    rim = edges[faces_at == 1]
    used = np.unique(faces)
    return Topology(
        components=_pieces(edges, used, n_vertices),
        boundary_loops=_pieces(rim, np.unique(rim), n_vertices),
        euler=len(used) - len(edges) + len(faces),
        nonmanifold_edges=int((faces_at > 2).sum()),
        pinched_vertices=int((np.bincount(rim.ravel(), minlength=n_vertices) > 2).sum()),
        unused_vertices=n_vertices - len(used),
        consistent_winding=bool((repeats == 1).all()),
    )


def _pieces(edges: NDArray, members: NDArray, n: int) -> int:
    """Connected components among `members`."""
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    return len(np.unique(connected_components(graph, directed=False)[1][members]))
