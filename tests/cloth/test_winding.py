import numpy as np
import pytest
import trimesh

from medor_cloth.garment import generate
from medor_cloth.winding import rim_edges, winding_grid, winding_numbers


@pytest.fixture(scope="module")
def skirt():
    garment = generate("skirt", 3, 0.03)
    return garment.vertices / 0.6 + 0.5, garment.faces


def test_inside_one_outside_zero_on_a_closed_sphere():
    ball = trimesh.creation.icosphere(3, radius=0.3)
    centre = np.array([0.5, 0.48, 0.53])
    grid = winding_grid(np.asarray(ball.vertices) + centre, np.asarray(ball.faces), 24)
    distance = np.linalg.norm(np.stack(np.meshgrid(*[np.linspace(0, 1, 24)] * 3, indexing="ij"), -1) - centre, axis=-1)
    np.testing.assert_allclose(grid[distance < 0.29], 1, atol=1e-6)
    np.testing.assert_allclose(grid[distance > 0.31], 0, atol=1e-6)


def test_half_a_sphere_is_half_inside_at_the_middle_of_its_rim():
    """A hemisphere covers half of what is seen from its centre: W = 1/2, and turning it inside out gives −1/2."""
    ball = trimesh.creation.icosphere(4)
    upper = ball.faces[ball.triangles_center[:, 2] > 0]
    centre = np.zeros((1, 3))
    assert winding_numbers(centre, ball.vertices, upper) == pytest.approx(0.5, abs=0.01)
    assert winding_numbers(centre, ball.vertices, upper[:, ::-1]) == pytest.approx(-0.5, abs=0.01)


def test_the_grid_equals_the_sum_over_all_triangles(skirt):
    vertices, faces = skirt
    grid = winding_grid(vertices, faces, 20)
    nodes = np.stack(np.meshgrid(*[np.linspace(0, 1, 20)] * 3, indexing="ij"), -1).reshape(-1, 3)
    np.testing.assert_allclose(grid.ravel(), winding_numbers(nodes, vertices, faces), atol=1e-5)


def test_a_skirt_is_about_one_inside_and_zero_outside(skirt):
    vertices, faces = skirt
    grid = winding_grid(vertices, faces, 32)
    middle = np.rint(vertices.mean(0) * 31).astype(int)
    assert grid[tuple(middle)] > 0.6
    assert np.abs(grid[[0, -1]]).max() < 0.1
    rim = rim_edges(faces)
    assert len(rim) == len(np.unique(rim[:, 0])), "each rim vertex leaves once"


def test_crossing_the_cloth_changes_the_winding_number_by_one(skirt):
    vertices, faces = skirt
    corners = vertices[faces[::17]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inner, outer = corners.mean(1) - 1e-5 * normal, corners.mean(1) + 1e-5 * normal
    jump = winding_numbers(inner, vertices, faces) - winding_numbers(outer, vertices, faces)
    np.testing.assert_allclose(jump, 1, atol=0.01)
