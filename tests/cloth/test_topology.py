"""Surfaces whose topology is known."""

import numpy as np

from medor_cloth.topology import topology

SHEET = np.array([[0, 1, 2], [0, 2, 3]])
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def tube(n: int) -> np.ndarray:
    """A prism's mantle: two rims."""
    i, j = np.arange(n), (np.arange(n) + 1) % n
    return np.vstack([np.column_stack([i, j, i + n]), np.column_stack([j, j + n, i + n])])


def test_a_sheet_is_a_sphere_with_one_hole():
    found = topology(SHEET, 4)
    assert found.is_sphere_with_holes(1)
    assert not found.is_sphere_with_holes(2)


def test_a_closed_surface_has_no_rim():
    found = topology(TETRAHEDRON, 4)
    assert (found.boundary_loops, found.euler) == (0, 2)
    assert found.is_sphere_with_holes(0)


def test_a_tube_has_two_rims():
    assert topology(tube(7), 14).is_sphere_with_holes(2)


def test_a_tube_closed_to_a_ring_is_told_from_a_sphere_by_euler_only():
    n, m = 5, 4
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b, c, d = (((i + p) % n * m + (j + q) % m).ravel() for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
    ring = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    found = topology(ring, n * m)
    assert (found.euler, found.nonmanifold_edges, found.components) == (0, 0, 1)
    assert not found.is_sphere_with_holes(0)


def test_a_third_face_at_an_edge_is_found():
    found = topology(np.vstack([SHEET, [[0, 2, 4]]]), 5)
    assert found.nonmanifold_edges == 1
    assert not found.is_sphere_with_holes(1)


def test_two_sheets_touching_at_a_vertex_are_pinched():
    found = topology(np.vstack([SHEET, SHEET + 3]), 7)
    assert (found.pinched_vertices, found.components) == (1, 1)


def test_pieces_unused_vertices_and_turned_faces_are_counted():
    apart = topology(np.vstack([SHEET, SHEET + 5]), 10)
    assert (apart.components, apart.unused_vertices, apart.boundary_loops) == (2, 2, 2)
    turned = topology(np.array([[0, 1, 2], [0, 3, 2]]), 4)
    assert not turned.consistent_winding
