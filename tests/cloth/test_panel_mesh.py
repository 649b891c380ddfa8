"""A flat panel is filled with even triangles, and with nothing outside it."""

import numpy as np
import pytest

from medor_cloth.outline import arc, line, resample
from medor_cloth.panel_mesh import contains, triangulate
from medor_cloth.triangles import smallest_angle_deg

EDGE = 0.03


def closed(*pieces):
    return np.vstack(
        [resample(p, max(1, round(np.linalg.norm(np.diff(p, axis=0), axis=1).sum() / EDGE)))[:-1] for p in pieces]
    )


def sector():
    lower, upper = arc(0.8, 1.0, 0.0), arc(0.3, 1.0, 0.0)
    return closed(lower, line(lower[-1], upper[-1]), upper[::-1], line(upper[0], lower[0]))


def ell():
    return closed(line((0, 0), (0.6, 0), (0.6, 0.2), (0.2, 0.2), (0.2, 0.6), (0, 0.6), (0, 0)))


def area(outline):
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@pytest.mark.parametrize("outline", [sector(), ell()], ids=["sector", "L"])
@pytest.mark.parametrize("seed", range(3))
def test_triangles_fill_the_outline_exactly(outline, seed):
    points, faces = triangulate(outline, EDGE, np.random.default_rng(seed))
    a, b, c = (points[faces[:, k]] for k in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert (doubled > 0).all(), "every triangle counter-clockwise"
    assert doubled.sum() / 2 == pytest.approx(area(outline), rel=1e-3)
    np.testing.assert_array_equal(points[: len(outline)], outline)


@pytest.mark.parametrize("outline", [sector(), ell()], ids=["sector", "L"])
def test_triangles_are_even(outline):
    points, faces = triangulate(outline, EDGE, np.random.default_rng(0))
    edges = np.linalg.norm(points[faces] - points[np.roll(faces, 1, axis=1)], axis=2)
    assert smallest_angle_deg(points[faces]) > 20
    assert edges.mean() == pytest.approx(EDGE, rel=0.1)
    assert edges.std() < 0.2 * EDGE


@pytest.mark.parametrize("outline", [sector(), ell()], ids=["sector", "L"])
def test_no_inner_edge_joins_two_points_of_the_outline(outline):
    points, faces = triangulate(outline, EDGE, np.random.default_rng(1))
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    inner = edges[count == 2]
    assert not (inner < len(outline)).all(axis=1).any()
    assert len(points) == len(np.unique(faces)), "every point is used"


def test_same_seed_same_mesh_other_seed_other_mesh():
    once, again, other = (triangulate(ell(), EDGE, np.random.default_rng(s))[0] for s in (5, 5, 6))
    np.testing.assert_array_equal(once, again)
    assert once.shape != other.shape or np.abs(once - other).max() > 1e-3


def test_inside_follows_the_notch():
    inside = contains(ell(), np.array([[0.1, 0.1], [0.5, 0.1], [0.1, 0.5], [0.4, 0.4], [-0.1, 0.1], [0.3, 0.7]]))
    assert inside.tolist() == [True, True, True, False, False, False]
