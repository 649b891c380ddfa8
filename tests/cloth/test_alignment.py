import numpy as np
import pytest

from medor_cloth.alignment import (
    align_in_plane,
    canonical_cost,
    canonical_cost_unmatched,
    moved_in_plane,
    rotation,
)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def tshirt(rng: np.random.Generator, n: int) -> np.ndarray:
    """Points inside the outline of a T-shirt, without mirror symmetry front to back or side to side."""
    xy = rng.uniform(-0.2, 0.2, (8 * n, 2))
    x, y = np.abs(xy[:, 0]), xy[:, 1]
    inside = ((x < 0.1) & (y > -0.15) & (y < 0.15)) | ((y > 0.07) & (y < 0.15) & (xy[:, 0] > -0.15))
    return np.concatenate([xy[inside][:n], rng.uniform(0, 0.005, (n, 1))], axis=1)


def test_a_turned_and_shifted_copy_is_found_exactly(rng):
    source = rng.normal(size=(40, 3))
    R, t = rotation(np.array(2.4)), np.array([0.3, -1.2])
    found_R, found_t = align_in_plane(source, moved_in_plane(source, R, t))
    np.testing.assert_allclose(found_R, R, atol=1e-12)
    np.testing.assert_allclose(found_t, t, atol=1e-12)


def test_fit_equals_the_singular_value_form_of_kabsch_and_never_mirrors(rng):
    for mirror in (1.0, -1.0):
        source, noise = rng.normal(size=(30, 2)), rng.normal(0, 0.2, (30, 2))
        target = source * [mirror, 1.0] + noise
        H = (source - source.mean(axis=0)).T @ (target - target.mean(axis=0))
        U, _, Vt = np.linalg.svd(H)
        expected = Vt.T @ np.diag([1, np.linalg.det(Vt.T @ U.T)]) @ U.T
        R, _ = align_in_plane(source, target)
        np.testing.assert_allclose(R, expected, atol=1e-9)
        assert np.linalg.det(R) == pytest.approx(1)


def test_no_other_turn_fits_better(rng):
    source, target = rng.normal(size=(2, 25, 3))
    R, t = align_in_plane(source, target)
    best = np.sum((moved_in_plane(source, R, t) - target) ** 2)
    for angle in (-0.01, 0.01, 0.5, np.pi):
        turned = moved_in_plane(source, rotation(np.array(angle)) @ R, t)
        turned[:, :2] += (target - turned)[:, :2].mean(axis=0)
        assert np.sum((turned - target) ** 2) > best


def test_leading_axes_are_fitted_one_by_one(rng):
    source, target = rng.normal(size=(10, 3)), rng.normal(size=(4, 2, 10, 3))
    R, t = align_in_plane(source, target)
    assert R.shape == (4, 2, 2, 2)
    assert t.shape == (4, 2, 2)
    one_R, one_t = align_in_plane(source, target[3, 1])
    np.testing.assert_allclose(R[3, 1], one_R)
    np.testing.assert_allclose(t[3, 1], one_t)


def test_cost_ignores_place_and_heading_but_not_mirroring_or_height(rng):
    goal = tshirt(rng, 200)
    moved = moved_in_plane(goal, rotation(np.array(-1.1)), np.array([0.1, 0.2]))
    assert canonical_cost(moved, goal[None]) < 1e-9
    assert canonical_cost(moved, goal[None], squared=True) < 1e-18
    assert canonical_cost(moved * [-1, 1, 1], goal[None]) > 0.02
    assert canonical_cost(moved + [0, 0, 0.03], goal[None]) == pytest.approx(0.03)
    assert canonical_cost(moved + [0, 0, 0.03], goal[None], squared=True) == pytest.approx(0.03**2)


def test_cost_is_that_of_the_nearest_goal_for_every_state(rng):
    goals, states = rng.normal(size=(3, 50, 3)), rng.normal(size=(2, 4, 50, 3))
    states[1, 2] = moved_in_plane(goals[2], rotation(np.array(0.7)), np.zeros(2))
    costs = canonical_cost(states, goals)
    assert costs.shape == (2, 4)
    assert costs[1, 2] < 1e-9
    assert costs[0, 0] > 0.1
    each = [canonical_cost(states, goals[s : s + 1]) for s in range(3)]
    np.testing.assert_array_equal(costs, np.min(each, axis=0))
    assert float(canonical_cost(states[0, 1], goals)) == pytest.approx(costs[0, 1])


def test_unmatched_cost_of_the_same_shape_is_small_wherever_it_lies(rng):
    goal, points = tshirt(rng, 600), tshirt(rng, 400)
    spacing = canonical_cost_unmatched(points, goal[None])
    for angle in np.linspace(0, 2 * np.pi, 6):
        moved = moved_in_plane(points, rotation(angle), np.array([0.1, -0.05]))
        assert canonical_cost_unmatched(moved, goal[None]) == pytest.approx(spacing, rel=0.15)
    # Samples of one area lie about half a mean spacing apart: 0.5 / sqrt(density).
    assert spacing < 1.0 / np.sqrt(600 / 0.075)


def test_unmatched_cost_of_the_goal_itself_is_zero_in_any_order(rng):
    goal = tshirt(rng, 150)
    moved = moved_in_plane(rng.permutation(goal), rotation(np.array(np.pi / 6)), np.array([0.3, 0.1]))
    assert canonical_cost_unmatched(moved, goal[None]) < 1e-9


def test_unmatched_cost_grows_when_cloth_lies_where_the_goal_has_none(rng):
    goal, points = tshirt(rng, 600), tshirt(rng, 400)
    stretched = points * [1.0, 1.5, 1.0]
    assert canonical_cost_unmatched(stretched, goal[None]) > 2 * canonical_cost_unmatched(points, goal[None])
    near, far = goal, goal * [0.3, 2.0, 1.0]
    assert canonical_cost_unmatched(points, np.stack([far, near])) == canonical_cost_unmatched(points, near[None])
