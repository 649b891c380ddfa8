"""Whole garments: what folds, pulls, rest, layers, step size and mesh must come to. Slow."""

from functools import cache

import numpy as np
import pytest

from benchmarks import fidelity
from benchmarks.fidelity import SEEDS, Flat
from medor_cloth.garment import CATEGORIES
from medor_cloth.intersection import self_intersections
from medor_cloth.start import dropped

pytestmark = pytest.mark.slow

GARMENTS = [(category, seed) for category, seeds in SEEDS.items() for seed in seeds]
laid_flat = cache(Flat)


@pytest.mark.parametrize(("category", "seed"), GARMENTS)
def test_a_corner_fold_stays_and_its_inverse_restores(category: str, seed: int):
    fold = fidelity.corner_fold(laid_flat(category, seed))
    assert fold.kept > 0.7
    assert fold.restored > 0.95


@pytest.mark.parametrize(("category", "seed"), GARMENTS)
def test_a_garment_in_half_stays_and_opens_again(category: str, seed: int):
    fold = fidelity.half_fold(laid_flat(category, seed))
    assert fold.kept > 0.7
    assert fold.restored > 0.9


@pytest.mark.parametrize(("category", "seed"), GARMENTS)
def test_a_corner_pull_unfolds_with_friction_and_drags_without(category: str, seed: int):
    flat = laid_flat(category, seed)
    rough, slippery = fidelity.corner_pull(flat), fidelity.corner_pull(flat, friction=False)
    assert rough.unfolded > 0.5
    assert rough.dragged_m < 0.5 * slippery.dragged_m


@pytest.mark.parametrize("category", CATEGORIES)
def test_disturbed_garments_come_to_rest_whole(category: str):
    rest = fidelity.rest(laid_flat(category, 800001), 0)
    assert rest.drift_m_s < 0.01
    assert rest.stretched < 0.02
    assert rest.compressed < 0.05
    assert rest.held < 0.05
    assert rest.crossings < 0.5


@pytest.mark.parametrize(("category", "seed"), [(category, seeds[0]) for category, seeds in SEEDS.items()])
def test_layers_show_in_depth(category: str, seed: int):
    flat = laid_flat(category, seed)
    assert fidelity.layer_step(flat) == pytest.approx(flat.solver.config.thickness, rel=0.3)


@pytest.mark.parametrize("edge", [0.012, 0.009])
@pytest.mark.parametrize("category", ["trousers", "dress", "tshirt"])
def test_dropped_garments_are_crumpled_but_whole(category: str, edge: float):
    flat = laid_flat(category, 800010, round(len(laid_flat(category, 800010).garment.vertices) * (0.012 / edge) ** 2))
    state = dropped(flat.solver, flat.state, np.random.default_rng(0))
    assert 0.2 < flat.covered(state) / flat.area < 0.7
    assert self_intersections(state.positions, flat.garment.faces) <= 0.01 * len(flat.garment.faces)
    assert np.percentile(fidelity.edge_strain(flat.solver, state.positions), 99) < 0.05
    assert state.positions[:, 2].max() > 0.02


def test_half_the_step_covers_as_much():
    """Single drops are chaotic; their mean over ten is good to two hundredths."""
    flat = laid_flat("tshirt", 800010)
    whole, half = (np.mean([fidelity.settled_coverage(flat, seed, steps) for seed in range(10)]) for steps in (12, 24))
    assert half == pytest.approx(whole, abs=0.05)


def test_other_meshes_cover_as_much():
    coarse, fine = (laid_flat("tshirt", 800010, vertices) for vertices in (700, 1500))
    means = [np.mean([fidelity.settled_coverage(flat, seed) for seed in range(10)]) for flat in (coarse, fine)]
    assert means[0] == pytest.approx(means[1], abs=0.05)
