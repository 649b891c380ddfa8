"""Compile everything a rollout needs before the first one is asked for."""

import numpy as np

from medor_cloth.cloth import Cloth
from medor_cloth.coverage import coverages
from medor_cloth.rollout import rollouts
from medor_cloth.solver import Solver

EDGE_M = 0.012


def warm_up() -> None:
    """Roll one pick-and-place out on a patch of four triangles' worth of cloth."""
    x, y = np.meshgrid(np.arange(3) * EDGE_M, np.arange(3) * EDGE_M, indexing="ij")
    vertices = np.stack([x, y, np.full_like(x, EDGE_M)], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = np.array([0, 1, 3, 4])
    faces = np.concatenate([[[c, c + 3, c + 4], [c, c + 4, c + 1]] for c in corner]).astype(np.int32)
    solver = Solver(Cloth.from_mesh(vertices, faces))
    pick = vertices[:1]
    coverages(rollouts(solver, vertices, pick, pick + np.float32(EDGE_M)), faces)
