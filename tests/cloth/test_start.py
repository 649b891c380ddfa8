import numpy as np
import pytest

from medor_cloth.coverage import coverage
from medor_cloth.errors import ClothError
from medor_cloth.garment import generate
from medor_cloth.goals import solver_of
from medor_cloth.start import VIEW_M, dropped, flattened, picked, random_pick


@pytest.fixture(scope="module")
def skirt():
    """A small coarse skirt: its solver and its flat state."""
    garment = generate("skirt", 800002, edge_m=0.02)
    solver = solver_of(garment)
    return solver, flattened(garment, solver)


def test_a_dropped_garment_lies_crumpled_under_the_camera(skirt):
    solver, flat = skirt
    state = dropped(solver, flat, np.random.default_rng(1))
    faces = solver.cloth.faces
    assert coverage(state.positions, faces) < 0.7 * coverage(flat.positions, faces)
    assert state.positions[:, 2].max() > 0.015
    np.testing.assert_allclose(state.positions[:, :2].mean(0), 0, atol=1e-5)
    assert not state.velocities.any()


def test_the_seed_decides_the_drop(skirt):
    solver, flat = skirt
    one, same, other = (dropped(solver, flat, np.random.default_rng(seed)).positions for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.01


def test_when_no_drop_is_crumpled_enough_it_says_so(skirt):
    solver, flat = skirt
    with pytest.raises(ClothError, match="none of 2 drops"):
        dropped(solver, flat, np.random.default_rng(1), max_coverage=0.01, tries=2)


def test_picks_disorder_the_cloth_and_keep_it_in_view(skirt):
    solver, flat = skirt
    state = picked(solver, flat, np.random.default_rng(3), picks=3)
    assert np.abs(state.positions[:, :2]).max() < VIEW_M
    assert coverage(state.positions, solver.cloth.faces) < 0.97 * coverage(flat.positions, solver.cloth.faces)


def test_a_random_pick_lies_on_top_of_the_cloth_and_never_goes_down(skirt):
    _, flat = skirt
    rng = np.random.default_rng(4)
    for _ in range(50):
        pick, place = random_pick(flat.positions, rng)
        above = np.linalg.norm(flat.positions[:, :2] - pick[:2], axis=1) < 0.001
        assert pick[2] == pytest.approx(flat.positions[above, 2].max() + 0.01, abs=1e-6)
        assert 0.05 - 1e-6 <= np.linalg.norm(place - pick) <= 0.2 + 1e-6
        assert place[2] >= pick[2]
