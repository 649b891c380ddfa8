"""The worn shape of a sewn garment, blown up from its flat panels.

The panels start in their flat places, bulged apart by a Poisson height, and follow a fixed number of steps of
projective dynamics (Bouaziz et al. 2014): springs towards the panels' edge lengths, quadratic bending, a slight
pressure.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from medor_cloth.pattern import Pattern
from medor_cloth.sewing import Sewn

STEPS = 100
"""Part of the garment's definition: the shape has not converged, so another count is another garment."""
BULGE = 0.64
"""Ratio of the starting depth to the membrane height √(2φ)."""
PRESSURE = 0.01
"""Inflating pressure times the edge length, in units of the springs' stiffness."""
BENDING = 0.02
INERTIA = 0.002
ANCHOR = 0.05
"""Stiffness that keeps shoulder seams at their height."""
BODY_DEPTH = 0.14
"""Depth of a torso [m], human scale: sets the stiffness that flattens the front and the back."""
OPENING_STIFFNESS, OPENING_WIDTH = 0.3, 0.02
"""How a front opening is kept from gaping beyond a width [m], human scale."""


def inflate(sewn: Sewn, pattern: Pattern) -> NDArray[np.float64]:
    """The worn shape, human scale, centred on its bounding box.

    Returns:
        (V, 3) vertices [m]: x lateral, y up, z towards the front.
    """
    springs = _Springs.of(sewn)
    area, laplacian = _area(sewn), _laplacian(sewn)
    shape = np.column_stack([*(sewn.mean(sewn.points[:, d]) for d in (0, 1)), _bulge(sewn, pattern, laplacian, area)])
    shape = _Inflation(sewn, pattern, springs, laplacian, area, shape).run(shape)
    return shape - (shape.max(axis=0) + shape.min(axis=0)) / 2


@dataclass(frozen=True)
class _Springs:
    difference: sparse.csr_array
    """(E, V) edge vectors = difference @ vertices."""
    rest: NDArray[np.float64]
    """(E,) edge lengths in the panels, averaged where two panels share a seam edge [m]."""

    @classmethod
    def of(cls, sewn: Sewn) -> "_Springs":
        n = sewn.n_vertices
        ends = sewn.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        size = np.linalg.norm(sewn.points[ends[:, 0]] - sewn.points[ends[:, 1]], axis=1)
        pairs = np.sort(sewn.vertex[ends], axis=1)
        key, of_edge, count = np.unique(pairs[:, 0] * n + pairs[:, 1], return_inverse=True, return_counts=True)
        return cls(_difference(np.column_stack([key // n, key % n]), n), np.bincount(of_edge, size) / count)


class _Inflation:
    """One factored system; each step projects the springs on their lengths and solves."""

    def __init__(
        self,
        sewn: Sewn,
        pattern: Pattern,
        springs: _Springs,
        laplacian: sparse.csr_array,
        area: NDArray[np.float64],
        start: NDArray[np.float64],
    ) -> None:
        edge = float(np.median(springs.rest))
        self.springs, self.faces, self.n = springs, sewn.vertex[sewn.faces], sewn.n_vertices
        self.pressure = PRESSURE / edge
        self.inertia = INERTIA * area / area.mean()
        self.lifted = sewn.mean(sewn.points[:, 1]) >= pattern.lift_above
        self.opening = _opening(sewn, pattern)
        self.anchor, self.height = _anchored(sewn), start[:, 1].copy()
        flattening = 0.6 * PRESSURE * 0.87 * edge / BODY_DEPTH * pattern.flatness
        stiffness = springs.difference.T @ springs.difference
        stiffness = stiffness + BENDING * edge**2 * (laplacian.T @ sparse.diags_array(1 / area) @ laplacian)
        stiffness = stiffness + OPENING_STIFFNESS * (self.opening.T @ self.opening)
        extra = (self.inertia, self.inertia + self.anchor, self.inertia * (1 + flattening / INERTIA))
        self.solvers = [splu((stiffness + sparse.diags_array(e)).tocsc()) for e in extra]

    def run(self, shape: NDArray) -> NDArray:
        for _ in range(STEPS):
            force = self._forces(shape)
            shape = np.column_stack([lu.solve(force[:, d]) for d, lu in enumerate(self.solvers)])
        return shape

    def _forces(self, shape: NDArray) -> NDArray:
        d = self.springs.difference
        force = d.T @ _with_length(d @ shape, self.springs.rest[:, None])
        gap = self.opening @ shape
        width = np.minimum(np.linalg.norm(gap, axis=1, keepdims=True), OPENING_WIDTH)
        force += OPENING_STIFFNESS * (self.opening.T @ _with_length(gap, width))
        force += self.pressure * self._blow(shape) + self.inertia[:, None] * shape
        force[:, 1] += self.anchor * self.height
        return force

    def _blow(self, shape: NDArray) -> NDArray:
        """Area-weighted vertex normals: where a unit pressure pushes."""
        a, b, c = (shape[self.faces[:, k]] for k in range(3))
        normal = np.repeat(np.cross(b - a, c - a) / 6, 3, axis=0)
        blow = np.column_stack([np.bincount(self.faces.ravel(), normal[:, d], self.n) for d in range(3)])
        blow[:, 1] *= self.lifted
        return blow


def _with_length(vectors: NDArray, size: NDArray) -> NDArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9) * size


def _difference(pairs: NDArray, n: int) -> sparse.csr_array:
    rows = np.repeat(np.arange(len(pairs)), 2)
    signs = np.tile([1.0, -1.0], len(pairs))
    return sparse.coo_array((signs, (rows, pairs.ravel())), shape=(len(pairs), n)).tocsr()


def _opening(sewn: Sewn, pattern: Pattern) -> sparse.csr_array:
    """(G, V) vectors across the front opening; none without one."""
    if pattern.opening is None:
        return _difference(np.empty((0, 2), np.int64), sewn.n_vertices)
    right, left = (sewn.vertex[sewn.edges[name]] for name in pattern.opening)
    pairs = np.column_stack([right, left[::-1]])
    return _difference(pairs[pairs[:, 0] != pairs[:, 1]], sewn.n_vertices)


def _anchored(sewn: Sewn) -> NDArray[np.float64]:
    """(V,) anchor stiffness: the shoulder seams."""
    stiffness = np.zeros(sewn.n_vertices)
    for (_, edge), points in sewn.edges.items():
        if edge.startswith("shoulder"):
            stiffness[sewn.vertex[points]] = ANCHOR
    return stiffness


def _area(sewn: Sewn) -> NDArray[np.float64]:
    """(V,) a third of the area of the faces around each vertex [m²]."""
    a, b, c = (sewn.points[sewn.faces[:, k]] for k in range(3))
    doubled = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return sewn.total(np.bincount(sewn.faces.ravel(), np.repeat(doubled / 6, 3), len(sewn.points)))


def _laplacian(sewn: Sewn) -> sparse.csr_array:
    """(V, V) cotangent Laplacian of the panels, sewn together; extreme cotangents are clipped."""
    rows, columns, weights = [], [], []
    for i, j, k in (sewn.faces.T, np.roll(sewn.faces.T, 1, axis=0), np.roll(sewn.faces.T, 2, axis=0)):
        u, v = sewn.points[i] - sewn.points[k], sewn.points[j] - sewn.points[k]
        sine = np.maximum(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), 1e-12)
        weight = 0.5 * np.clip((u * v).sum(axis=1) / sine, -2.0, 5.0)
        rows += [sewn.vertex[i], sewn.vertex[j]]
        columns += [sewn.vertex[j], sewn.vertex[i]]
        weights += [weight, weight]
    n = sewn.n_vertices
    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    adjacency = sparse.coo_array(entries, shape=(n, n)).tocsr()
    return (sparse.diags_array(adjacency.sum(axis=1)) - adjacency).tocsr()


def _bulge(sewn: Sewn, pattern: Pattern, laplacian: sparse.csr_array, area: NDArray) -> NDArray[np.float64]:
    """(V,) starting depth: a membrane of unit load, held at the seams between front and back."""
    free = np.ones(sewn.n_vertices, bool)
    for seam in pattern.seams:
        if pattern.panels[seam.first[0]].front != pattern.panels[seam.second[0]].front:
            free[sewn.vertex[sewn.edges[seam.first]]] = False
    height = np.zeros(sewn.n_vertices)
    height[free] = splu(laplacian[free][:, free].tocsc()).solve(area[free])
    side = np.sign(sewn.mean(np.where(sewn.front, 1.0, -1.0)))
    return side * BULGE * np.sqrt(np.maximum(2 * height, 0.0))
