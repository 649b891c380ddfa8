"""Triangulation of one flat panel with nearly equilateral triangles of a given size.

A hexagonal lattice inside the outline is relaxed by edge forces (as in DistMesh) and triangulated by Delaunay; the
outline's own samples stay where they are, so that seams match.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

Points = NDArray[np.float64]
Triangles = NDArray[np.int64]

RELAXATIONS = 25
RETRIANGULATE_EVERY = 6
OVERPRESSURE = 1.15
"""Target length of the springs over the wanted one: all push, so that points spread to the outline."""


def triangulate(outline: Points, edge: float, rng: np.random.Generator) -> tuple[Points, Triangles]:
    """Fill a closed outline.

    Args:
        outline: (B, 2) samples about `edge` apart [m], counter-clockwise, the last one not repeating the first.
        edge: wanted edge length [m].
        rng: chooses the lattice's turn and offset.

    Returns:
        Points (P, 2), the outline first, and counter-clockwise triangles (T, 3). No inner edge joins two points of
        the outline: sewn to another panel with the same edge it would carry four faces.
    """
    rim = KDTree(np.vstack([outline, (outline + np.roll(outline, -1, axis=0)) / 2]))
    inner = _lattice(outline, edge, rng)
    inner = inner[rim.query(inner)[0] > 0.62 * edge]
    inner = _relax(outline, inner, edge, rim)
    points = np.vstack([outline, inner])
    while True:
        faces = _delaunay(points, outline, edge)
        chords = _chords(faces, len(outline), len(points))
        if not len(chords):
            return points, faces
        points = np.vstack([points, points[chords].mean(axis=1)])


def contains(outline: Points, points: Points) -> NDArray[np.bool_]:
    """Which points (N, 2) lie inside a closed outline (even-odd rule)."""
    x, y = points[:, :1], points[:, 1:]
    (x0, y0), (x1, y1) = outline.T, np.roll(outline, -1, axis=0).T
    rise = np.where(y1 == y0, 1.0, y1 - y0)  # level pieces never straddle a ray; their slope does not matter
    straddles = (y0 > y) != (y1 > y)
    return (straddles & (x < x0 + (x1 - x0) * (y - y0) / rise)).sum(axis=1) % 2 == 1


def _lattice(outline: Points, edge: float, rng: np.random.Generator) -> Points:
    low, high = outline.min(axis=0), outline.max(axis=0)
    n = int(np.linalg.norm(high - low) / edge * 0.6) + 3
    i, j = np.meshgrid(np.arange(-n, n + 1), np.arange(-int(1.2 * n), int(1.2 * n) + 1))
    lattice = np.column_stack([(i + 0.5 * (j % 2)).ravel(), j.ravel() * np.sqrt(3) / 2]) * edge
    angle = rng.uniform(0, np.pi / 3)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    lattice = lattice @ turn + (low + high) / 2 + rng.uniform(-edge / 2, edge / 2, 2)
    lattice = lattice[((lattice > low) & (lattice < high)).all(axis=1)]
    return lattice[contains(outline, lattice)]


def _relax(outline: Points, inner: Points, edge: float, rim: KDTree) -> Points:
    n_rim = len(outline)
    pairs = np.empty((0, 2), np.int64)
    for step in range(RELAXATIONS):
        points = np.vstack([outline, inner])
        if step % RETRIANGULATE_EVERY == 0:
            pairs = _edges(_delaunay(points, outline, edge), len(points))
        move = 0.2 * _repulsion(points, pairs, OVERPRESSURE * edge)[n_rim:]
        size = np.linalg.norm(move, axis=1, keepdims=True)
        moved = inner + move * np.minimum(1.0, 0.25 * edge / np.maximum(size, 1e-12))
        clear = rim.query(moved)[0] > 0.5 * edge
        inner = np.where(clear[:, None], moved, inner)
    return inner


def _repulsion(points: Points, pairs: NDArray[np.int64], reach: float) -> Points:
    """Sum over the edges at each point of the unit push times how much the edge is too short."""
    apart = points[pairs[:, 0]] - points[pairs[:, 1]]
    size = np.linalg.norm(apart, axis=1, keepdims=True)
    push = np.maximum(reach - size, 0.0) / size * apart
    force = np.zeros_like(points)
    for d in (0, 1):
        force[:, d] = np.bincount(pairs[:, 0], push[:, d], len(points))
        force[:, d] -= np.bincount(pairs[:, 1], push[:, d], len(points))
    return force


def _delaunay(points: Points, outline: Points, edge: float) -> Triangles:
    """Counter-clockwise Delaunay triangles inside the outline, without the slivers along straight rims."""
    faces = Delaunay(points).simplices.astype(np.int64)
    faces = faces[contains(outline, points[faces].mean(axis=1))]
    a, b, c = (points[faces[:, k]] for k in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces[doubled < 0] = faces[doubled < 0][:, ::-1]
    return faces[np.abs(doubled) > 1e-4 * edge**2]


def _edges(faces: Triangles, n: int) -> NDArray[np.int64]:
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    key = np.unique(pairs[:, 0] * n + pairs[:, 1])
    return np.column_stack([key // n, key % n])


def _chords(faces: Triangles, n_rim: int, n: int) -> NDArray[np.int64]:
    """Inner edges (M, 2) between two points of the outline."""
    pairs = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    key, count = np.unique(pairs[:, 0] * n + pairs[:, 1], return_counts=True)
    shared = key[count == 2]
    ends = np.column_stack([shared // n, shared % n])
    return ends[(ends < n_rim).all(axis=1)]
