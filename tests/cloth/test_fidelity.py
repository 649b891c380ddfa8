"""Whole garments: what a fold, a drop and a tangle must look like. Slow."""

import numpy as np
import pytest

from medor_cloth.coverage import coverage
from medor_cloth.garment import generate
from medor_cloth.goals import flattened, solver_of
from medor_cloth.intersection import self_intersections
from medor_cloth.solver import ClothState, Solver
from medor_cloth.start import dropped
from tests.cloth.sheets import strain

pytestmark = pytest.mark.slow


def carry(solver: Solver, state: ClothState, vertex: int, target: np.ndarray) -> ClothState:
    """A vertex carried over an arc to a place on the table and let go there; at rest after two seconds."""
    start = state.positions[vertex]
    u = np.linspace(0, 1, 71)[1:, None]
    u = u * u * (3 - 2 * u)
    path = start + u * (target - start)
    path[:, 2] += 0.5 * np.linalg.norm(target - start) * np.sin(np.pi * u[:, 0])
    state = solver.placed(state, start)
    state = solver.advance(state, 70, picker_path=path, holding=np.ones(70, bool))
    return solver.advance(state, 200, settle_speed=0.02)


@pytest.mark.parametrize(("category", "seed"), [("tshirt", 800004), ("trousers", 800123), ("skirt", 800009)])
def test_a_corner_fold_stays_and_its_inverse_restores(category: str, seed: int):
    garment = generate(category, seed)
    solver = solver_of(garment)
    flat = flattened(garment, solver)
    area = coverage(flat.positions, garment.faces)
    x, y = flat.positions[:, :2].T
    corner = int((0.8 * x + y).argmin())
    fold = np.array([1, 1, 0]) / np.sqrt(2)
    way = np.array([0.12, 0.12, 0])  # the crease cuts 12 cm off both sides of a square corner
    mirrored = flat.positions.copy()
    depth = (mirrored - flat.positions[corner] - way / 2) @ fold
    mirrored[depth < 0] -= 2 * depth[depth < 0, None] * fold.astype(np.float32)

    folded = carry(solver, flat, corner, flat.positions[corner] + way + [0, 0, 0.005])
    hidden, ideal = (area - coverage(p, garment.faces) for p in (folded.positions, mirrored))
    assert hidden > 0.7 * ideal
    opened = carry(solver, folded, corner, flat.positions[corner])
    assert coverage(opened.positions, garment.faces) > 0.97 * area


@pytest.mark.parametrize("edge", [0.012, 0.009])
@pytest.mark.parametrize("category", ["trousers", "dress", "tshirt"])
def test_dropped_garments_are_crumpled_but_whole(category: str, edge: float):
    garment = generate(category, 800010, edge_m=edge)
    solver = solver_of(garment)
    flat = flattened(garment, solver)
    state = dropped(solver, flat, np.random.default_rng(0))
    assert 0.2 < coverage(state.positions, garment.faces) / coverage(flat.positions, garment.faces) < 0.7
    assert self_intersections(state.positions, garment.faces) <= 0.01 * len(garment.faces)
    assert np.percentile(strain(solver, state.positions), 99) < 0.05
    assert state.positions[:, 2].max() > 0.02
