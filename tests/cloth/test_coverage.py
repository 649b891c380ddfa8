import numpy as np
import pytest

from medor_cloth.alignment import rotation
from medor_cloth.coverage import REACH_M, coverage, coverages, point_coverage


def sheet(n: int, width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet of n x n vertices centred on the origin."""
    x, y = np.meshgrid(np.linspace(-width / 2, width / 2, n), np.linspace(-height / 2, height / 2, n))
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float32)
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)]).astype(np.int32)


def moved(vertices, angle, shift):
    xy = vertices[:, :2] @ rotation(np.asarray(angle)).T + shift
    return np.concatenate([xy, vertices[:, 2:]], axis=1).astype(np.float32)


def test_a_flat_square_covers_its_area_however_finely_it_is_cut():
    for n in (2, 3, 17, 60):
        assert coverage(*sheet(n, 0.2137, 0.2137)) == pytest.approx(0.2137**2, rel=2e-3)


def test_moving_and_turning_the_cloth_changes_nothing():
    rng = np.random.default_rng(0)
    vertices, faces = sheet(12, 0.2153, 0.1071)
    angles = np.concatenate([rng.uniform(0, 2 * np.pi, 100), np.zeros(50)])
    angles[-20:] = np.arctan((np.sqrt(5) - 1) / 2)  # hems along the lattice: the worst case
    areas = [coverage(moved(vertices, angle, rng.uniform(-0.2, 0.2, 2)), faces) for angle in angles]
    np.testing.assert_allclose(areas, 0.2153 * 0.1071, rtol=5e-3)
    assert np.std(areas[:100]) / np.mean(areas[:100]) < 5e-4


def test_height_and_winding_do_not_matter():
    vertices, faces = sheet(8, 0.2, 0.1)
    lifted = vertices + np.random.default_rng(1).uniform(0, 0.1, (len(vertices), 1)) * [0, 0, 1]
    assert coverage(lifted, faces[:, ::-1]) == coverage(vertices, faces)


def test_layers_count_once():
    vertices, faces = sheet(10, 0.2, 0.2)
    two_layers = np.concatenate([vertices, vertices + np.array([0, 0, 0.005], np.float32)])
    both = np.concatenate([faces, faces + len(vertices)])
    assert coverage(two_layers, both) == coverage(vertices, faces)
    half_over = np.concatenate([vertices, vertices + np.array([0.1, 0, 0.005], np.float32)])
    assert coverage(half_over, both) == pytest.approx(0.3 * 0.2, rel=2e-3)


def test_folding_a_sheet_in_half_halves_its_coverage():
    vertices, faces = sheet(21, 0.2, 0.3)
    folded = vertices.copy()
    folded[:, 0] = -np.abs(folded[:, 0])
    assert coverage(folded, faces) == pytest.approx(coverage(vertices, faces) / 2, rel=2e-3)
    on_edge = vertices[:, [2, 1, 0]]  # a sheet standing on its edge hides nothing
    assert coverage(on_edge, faces) < 1e-3 * coverage(vertices, faces)


def test_union_equals_an_independent_count_of_points_in_triangles():
    rng = np.random.default_rng(2)
    vertices = rng.uniform(-0.15, 0.15, (30, 3)).astype(np.float32)
    faces = rng.permuted(np.tile(np.arange(30), (12, 1)), axis=1)[:, :3]
    a, b, c = (vertices[faces[:, k], :2].astype(np.float64) for k in range(3))
    samples = rng.uniform(-0.15, 0.15, (100_000, 1, 2))

    def side(p, q):
        return (q - p)[:, 0] * (samples - p)[..., 1] - (q - p)[:, 1] * (samples - p)[..., 0] > 0

    sides = np.stack([side(a, b), side(b, c), side(c, a)])
    inside = np.any(sides.all(axis=0) | ~sides.any(axis=0), axis=1)
    assert coverage(vertices, faces) == pytest.approx(inside.mean() * 0.3**2, rel=0.02)


def test_a_batch_gives_what_each_state_gives_with_any_number_of_threads():
    rng = np.random.default_rng(3)
    vertices, faces = sheet(9, 0.2, 0.2)
    batch = vertices + rng.normal(0, 0.02, (7, *vertices.shape)).astype(np.float32)
    one_by_one = [coverage(state, faces) for state in batch]
    for threads in (0, 1, 2, 16):
        np.testing.assert_array_equal(coverages(batch, faces, threads=threads), one_by_one)
    assert coverages(batch[:0], faces).shape == (0,)


def test_cloth_that_flew_away_or_is_not_finite_does_not_count():
    vertices, faces = sheet(5, 0.2, 0.2)
    whole = coverage(vertices, faces)
    torn = vertices.copy()
    torn[0] = np.nan
    assert 0.9 * whole < coverage(torn, faces) < whole
    assert coverage(vertices + np.array([10, 0, 0], np.float32), faces) == 0
    assert coverage(np.full_like(vertices, np.inf), faces) == 0
    assert coverage(vertices * 1e6, faces) <= (2 * REACH_M) ** 2 * 1.001  # bounded memory, bounded answer


def test_point_coverage_of_a_known_layout():
    # Box 1 m x 1 m, cells of 1 cm, squares of 10 x 10 cells: whole in the middle, a quarter at a corner.
    points = np.array([[0, 0, 0], [1, 1, 0], [0.5, 0.5, 0.3]])
    assert point_coverage(points, radius=0.0501) == pytest.approx((25 + 25 + 100) * 1e-4)


def test_point_coverage_marks_the_half_open_ranges_of_every_point():
    rng = np.random.default_rng(4)
    points, radius = rng.uniform(-0.2, 0.2, (80, 3)), 0.01
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    cell = (high - low) / 100
    marked = np.zeros((100, 100), bool)
    for x, y in points[:, :2]:
        i0, i1 = np.clip(np.round((np.array([x - radius, x + radius]) - low[0]) / cell[0]), 0, 100).astype(int)
        j0, j1 = np.clip(np.round((np.array([y - radius, y + radius]) - low[1]) / cell[1]), 0, 100).astype(int)
        marked[i0:i1, j0:j1] = True
    assert point_coverage(points, radius) == pytest.approx(marked.sum() * cell[0] * cell[1])
    assert point_coverage(points + [3, -2, 1], radius) == pytest.approx(point_coverage(points, radius), rel=0.01)


def test_point_coverage_of_dense_points_tends_to_the_area():
    vertices, faces = sheet(201, 0.2, 0.2)
    assert point_coverage(vertices, 0.0015) == pytest.approx(0.04, rel=1e-3)
    assert point_coverage(vertices, 0.0015) == pytest.approx(coverage(vertices, faces), rel=5e-3)
    assert point_coverage(vertices[:1]) == 0  # a single point spans no box
