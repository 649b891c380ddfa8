"""Whole garments: what folds, pulls, rest, layers, step size and mesh must come to. Slow."""

from functools import cache

import numpy as np
import pytest

from benchmarks import fidelity
from benchmarks.fidelity import SEEDS, Flat
from medor_cloth.camera import overhead
from medor_cloth.garment import CATEGORIES
from medor_cloth.intersection import self_intersections
from medor_cloth.raster import rasterize
from medor_cloth.start import dropped
from tests.cloth.sheets import sheet, solver_of

pytestmark = pytest.mark.slow

GARMENTS = [(category, seed) for category, seeds in SEEDS.items() for seed in seeds]
NARROW = ("trousers", 800124)
OPENS = pytest.mark.xfail(strict=True, reason="a leg narrower than its fold stands up and rolls open again")
FOLDABLE = [pytest.param(*garment, marks=OPENS if garment == NARROW else ()) for garment in GARMENTS]
laid_flat = cache(Flat)


@pytest.mark.parametrize(("category", "seed"), FOLDABLE)
def test_a_corner_fold_stays_and_its_inverse_restores(category: str, seed: int):
    fold = fidelity.corner_fold(laid_flat(category, seed))
    assert fold.kept > 0.7
    assert fold.restored > 0.97


def test_garments_in_half_stay_and_open_again():
    folds = [fidelity.half_fold(laid_flat(category, seed)) for category, seed in GARMENTS]
    assert min(fold.kept for fold in folds) > 0.7
    assert np.median([fold.restored for fold in folds]) > 0.9


@pytest.mark.parametrize(("category", "seed"), FOLDABLE)
def test_a_corner_pull_unfolds_with_friction_and_drags_without(category: str, seed: int):
    flat = laid_flat(category, seed)
    rough, slippery = fidelity.corner_pull(flat), fidelity.corner_pull(flat, friction=False)
    assert rough.unfolded > 0.5
    assert rough.dragged_m < 0.25 * slippery.dragged_m


@pytest.mark.parametrize("category", CATEGORIES)
def test_disturbed_garments_come_to_rest_whole(category: str):
    rest = fidelity.rest(laid_flat(category, 800001), 0)
    assert rest.drift_m_s < 0.01
    assert rest.stretched < 0.02
    assert rest.compressed < 0.08
    assert rest.held < 0.08
    assert rest.crossings < 0.5


def test_a_second_layer_is_one_thickness_higher_in_depth():
    vertices, faces = sheet(32, 16)
    solver = solver_of(vertices, faces)
    lying = vertices - vertices.mean(axis=0) + [0, 0, 0.0025]
    folded, over = lying.copy(), lying[:, 0] > 0
    folded[over] = folded[over] * [-1, 1, 1] + [0, 0, 0.006]
    settled = solver.advance(solver.rest(folded), 200).positions
    camera = overhead(360)
    one, two = (rasterize(x.astype(np.float32), faces, camera).depth for x in (lying, settled))
    far = (one > 0) & (two > 0) & (camera.back_project(two)[..., 0] < -0.1)  # the crease itself is a loop
    assert np.median((one - two)[far]) == pytest.approx(solver.config.thickness, rel=0.3)


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
