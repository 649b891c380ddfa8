"""From a pattern to one sewn mesh: every panel is triangulated, then seam points are welded in pairs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from medor_cloth.outline import length, resample
from medor_cloth.panel_mesh import triangulate
from medor_cloth.pattern import EdgeName, Panel, Pattern


@dataclass(frozen=True)
class Sewn:
    """Triangulated panels and the vertices that their points become when sewn.

    A *point* lies in one panel; a *vertex* of the garment is one point, or two and more welded in a seam.
    """

    points: NDArray[np.float64]
    """(P, 2) panel coordinates [m]."""
    faces: NDArray[np.int64]
    """(F, 3) points; counter-clockwise on front panels, clockwise on back panels: outwards when worn."""
    vertex: NDArray[np.int64]
    """(P,) the vertex of each point."""
    front: NDArray[np.bool_]
    """(P,) whether the point's panel is a front panel."""
    edges: dict[EdgeName, NDArray[np.int64]]
    """The points along each panel edge, in the outline's direction."""

    @property
    def n_vertices(self) -> int:
        return int(self.vertex.max()) + 1

    def mean(self, values: NDArray) -> NDArray[np.float64]:
        """(V,) mean over the points of each vertex of `values` (P,)."""
        return self.total(values) / np.bincount(self.vertex)

    def total(self, values: NDArray) -> NDArray[np.float64]:
        """(V,) sum over the points of each vertex of `values` (P,)."""
        return np.asarray(np.bincount(self.vertex, values, self.n_vertices), np.float64)


def sew(pattern: Pattern, edge: float, rng: np.random.Generator) -> Sewn:
    """Triangulate and weld a pattern with edges about `edge` long [m]."""
    counts = _segments(pattern, edge)
    points, faces, front, edges, start = [], [], [], {}, 0
    for name, panel in pattern.panels.items():
        outline, along = _sampled_outline(panel, [counts[name, e] for e in panel.edges])
        xy, triangles = triangulate(outline, edge, rng)
        edges |= {(name, e): ids + start for e, ids in along.items()}
        points.append(xy)
        faces.append((triangles if panel.front else triangles[:, ::-1]) + start)
        front.append(np.full(len(xy), panel.front))
        start += len(xy)
    return Sewn(np.vstack(points), np.vstack(faces), _weld(pattern, edges, start), np.concatenate(front), edges)


def _segments(pattern: Pattern, edge: float) -> dict[EdgeName, int]:
    """How many mesh edges each panel edge gets: equal on both sides of a seam."""
    lengths = {(p, e): length(c) for p, panel in pattern.panels.items() for e, c in panel.edges.items()}
    for seam in pattern.seams:
        lengths[seam.first] = lengths[seam.second] = (lengths[seam.first] + lengths[seam.second]) / 2
    return {name: max(1, round(size / edge)) for name, size in lengths.items()}


def _sampled_outline(panel: Panel, counts: list[int]) -> tuple[NDArray, dict[str, NDArray]]:
    """The closed outline (B, 2) and, for every edge, the indices of its points with both ends."""
    pieces = [resample(curve, n)[:-1] for curve, n in zip(panel.edges.values(), counts, strict=True)]
    starts = np.r_[0, np.cumsum(counts)]
    along = {
        name: np.arange(a, b + 1) % starts[-1] for name, a, b in zip(panel.edges, starts[:-1], starts[1:], strict=True)
    }
    return np.vstack(pieces), along


def _weld(pattern: Pattern, edges: dict[EdgeName, NDArray], n_points: int) -> NDArray[np.int64]:
    """(P,) vertex of each point: seams unite points, transitively where seams meet."""
    first = np.concatenate([edges[s.first] for s in pattern.seams])
    second = np.concatenate([edges[s.second][:: -1 if s.opposed else 1] for s in pattern.seams])
    sewn = coo_array((np.ones(len(first)), (first, second)), shape=(n_points, n_points))
    return connected_components(sewn, directed=False)[1].astype(np.int64)
