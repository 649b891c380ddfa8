"""Small sheets of cloth that tests throw about."""

from typing import Any

import numpy as np

from medor_cloth.cloth import Cloth
from medor_cloth.solver import Solver, SolverConfig

EDGE_M = 0.012


def sheet(columns: int, rows: int, edge: float = EDGE_M) -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet of right triangles in the plane z = 0, its diagonals alternating: vertices (V,3), faces (F,3)."""
    j, i = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
    vertices = np.stack([j * edge, i * edge, np.zeros_like(j, float)], -1).reshape(-1, 3).astype(np.float32)
    row, column = np.divmod(np.arange(rows * columns), columns)
    a = row * (columns + 1) + column
    b, c, d = a + 1, a + columns + 1, a + columns + 2
    even = ((row + column) % 2 == 0)[:, None]
    first = np.where(even, np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(even, np.stack([a, d, c], 1), np.stack([b, d, c], 1))
    return vertices, np.concatenate([first, second]).astype(np.int32)


def solver_of(vertices: np.ndarray, faces: np.ndarray, **constants: Any) -> Solver:
    return Solver(Cloth.from_mesh(vertices, faces), SolverConfig(**constants))


def strain(solver: Solver, positions: np.ndarray) -> np.ndarray:
    """Relative change of length of every edge (E,)."""
    ends = positions[solver.cloth.edges]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / solver.cloth.rest_lengths - 1
