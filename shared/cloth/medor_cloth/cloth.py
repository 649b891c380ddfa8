"""What a solver needs to know of a garment: its topology and its rest shape."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from medor_cloth.colouring import colour
from medor_cloth.errors import MeshError


class Springs(NamedTuple):
    """Distance springs sorted into colours: no vertex appears twice within one colour."""

    pairs: NDArray[np.int32]
    """Vertices of each spring (E,2)."""
    rest_lengths: NDArray[np.float32]
    """Rest lengths (E,) [m]."""
    colours: NDArray[np.int32]
    """Colour c holds the springs colours[c] … colours[c+1]-1."""


@dataclass(frozen=True)
class Cloth:
    """Topology and rest shape of a cloth; immutable, shared by all states of it.

    Args:
        n_vertices: Number of vertices V.
        faces: Triangles (F,3).
        stretch: One spring per mesh edge.
        bend: One spring between the two vertices opposite to each edge inside a panel, at its length in the flat
            panel. Edges between panels are seams and fold freely.
        areas: Rest area of each face (F,) [m²].
        squares: Sum of the squared rest lengths of each face's sides (F,) [m²].
        across: For each face the vertices opposite to its three edges (F,3), -1 at a boundary.
    """

    n_vertices: int
    faces: NDArray[np.int32]
    stretch: Springs
    bend: Springs
    across: NDArray[np.int32]
    areas: NDArray[np.float32]
    squares: NDArray[np.float32]

    @property
    def edges(self) -> NDArray[np.int32]:
        """Unique undirected mesh edges (E,2)."""
        return self.stretch.pairs

    @property
    def rest_lengths(self) -> NDArray[np.float32]:
        """Rest length of each edge (E,) [m]."""
        return self.stretch.rest_lengths

    @classmethod
    def from_mesh(
        cls,
        vertices: NDArray[np.float32],
        faces: NDArray[np.int32],
        panel_uv: NDArray[np.float32] | None = None,
    ) -> "Cloth":
        """The cloth of a triangle mesh.

        Args:
            vertices: Positions (V,3) [m]; the rest shape where there are no panels.
            faces: Triangles (F,3) with consistent winding.
            panel_uv: Flat panel coordinates of each face corner (F,3,2) [m]. Every face measures its edges on its own
                panel, since a seam vertex lies at two places; an edge of two faces takes the mean.

        Raises:
            MeshError: If shapes do not fit, a face names a missing vertex or has no area.
        """
        vertices, faces = np.asarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
            raise MeshError(f"expected vertices (V,3) and faces (F,3), got {vertices.shape} and {faces.shape}")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise MeshError(f"faces name vertices {faces.min()}…{faces.max()}, there are {len(vertices)}")
        corners = vertices[faces] if panel_uv is None else np.asarray(panel_uv, np.float32)
        if corners.shape[:2] != faces.shape:
            raise MeshError(f"expected panel_uv {faces.shape + (2,)}, got {corners.shape}")
        halves = _half_edges(faces, corners.astype(np.float64))
        if halves.length.min() < 1e-6 or halves.height.min() < 1e-7:
            raise MeshError("the rest shape has a face without area")
        pairs, inverse, counts = np.unique(halves.pair, axis=0, return_inverse=True, return_counts=True)
        rest = np.bincount(inverse, halves.length) / counts
        first, second = _twins(inverse, counts)
        inside = _same_panel(halves, first, second) if panel_uv is not None else np.ones(len(first), bool)
        along = halves.along[first] - halves.along[second]
        reach = halves.height[first] + halves.height[second]
        hinges = np.stack([halves.opposite[first], halves.opposite[second]], 1)
        inside &= hinges[:, 0] != hinges[:, 1]
        across = np.full(faces.size, -1, np.int32)
        across[first], across[second] = halves.opposite[second], halves.opposite[first]
        n = len(vertices)
        return cls(
            n_vertices=n,
            faces=faces,
            stretch=_springs(pairs, rest, n),
            bend=_springs(hinges[inside], np.hypot(along, reach)[inside], n),
            across=across.reshape(faces.shape),
            areas=(halves.length * halves.height / 2).reshape(faces.shape)[:, 0].astype(np.float32),
            squares=(halves.length**2).reshape(faces.shape).sum(1).astype(np.float32),
        )


class _HalfEdges(NamedTuple):
    """The three sides of every face, face-major: (3F, …)."""

    pair: NDArray[np.int32]
    opposite: NDArray[np.int32]
    length: NDArray[np.float64]
    along: NDArray[np.float64]
    height: NDArray[np.float64]
    ends: NDArray[np.float64]
    apex: NDArray[np.float64]


def _half_edges(faces: NDArray[np.int32], corners: NDArray[np.float64]) -> _HalfEdges:
    """Sides of the faces, each from its lower to its higher vertex, with the apex in the side's own frame."""
    start, end, opposite = faces, np.roll(faces, -1, 1), np.roll(faces, -2, 1)
    p, q, apex = corners, np.roll(corners, -1, 1), np.roll(corners, -2, 1)
    swap = start > end
    low, high = np.where(swap[..., None], q, p), np.where(swap[..., None], p, q)
    length = np.linalg.norm(high - low, axis=-1)
    along = ((apex - low) * (high - low)).sum(-1) / np.maximum(length, 1e-12)
    height = np.sqrt(np.maximum(((apex - low) ** 2).sum(-1) - along**2, 0.0))
    pair = np.stack([np.minimum(start, end), np.maximum(start, end)], -1)
    ends = np.concatenate([low, high], -1)
    return _HalfEdges(
        pair.reshape(-1, 2),
        opposite.reshape(-1),
        length.reshape(-1),
        along.reshape(-1),
        height.reshape(-1),
        ends.reshape(-1, ends.shape[-1]),
        apex.reshape(-1, apex.shape[-1]),
    )


def _twins(inverse: NDArray[np.intp], counts: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Half-edge indices of the two faces at every edge that has exactly two."""
    order = np.argsort(inverse, kind="stable")
    starts = np.cumsum(counts) - counts
    inner = starts[counts == 2]
    return order[inner], order[inner + 1]


def _same_panel(halves: _HalfEdges, first: NDArray[np.intp], second: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether two faces lie side by side on one panel: same place of their edge, apexes on different sides of it."""
    together = np.abs(halves.ends[first] - halves.ends[second]).max(1) < 1e-6
    low, high = halves.ends[first, :2], halves.ends[first, 2:]
    sides = [_cross(high - low, halves.apex[half] - low) > 0 for half in (first, second)]
    return together & (sides[0] != sides[1])


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _springs(pairs: NDArray[np.int32], rest: NDArray[np.float64], n_vertices: int) -> Springs:
    colours = colour(np.ascontiguousarray(pairs, np.int32), n_vertices)
    order = np.argsort(colours, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(colours))])
    return Springs(
        np.ascontiguousarray(pairs[order], np.int32), rest[order].astype(np.float32), starts.astype(np.int32)
    )
