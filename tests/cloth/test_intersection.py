"""Faces that cross are found, faces that only touch or neighbour are not."""

import numpy as np
import pytest

from medor_cloth.intersection import self_intersections

FACES = np.array([[0, 1, 2], [3, 4, 5]])
FLAT = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
UPRIGHT = np.array([[0.2, 0.2, -0.5], [0.3, 0.2, 0.5], [0.2, 0.3, 0.5]])


def test_a_piercing_triangle_crosses_wherever_it_stands():
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    both = np.vstack([FLAT, UPRIGHT])
    assert self_intersections(both, FACES) == 1
    assert self_intersections(both @ turn + rng.normal(size=3), FACES) == 1


@pytest.mark.parametrize("shift", [(0, 0, 0.6), (2, 0, 0), (0.6, 0.6, 0)])
def test_triangles_apart_do_not_cross(shift):
    assert self_intersections(np.vstack([FLAT, UPRIGHT + shift]), FACES) == 0


def test_layers_close_together_do_not_cross():
    assert self_intersections(np.vstack([FLAT, FLAT + (0.1, 0.1, 1e-4)]), FACES) == 0


def test_faces_that_share_a_vertex_are_neighbours():
    vertices = np.vstack([FLAT, UPRIGHT[1:]])
    assert self_intersections(vertices, np.array([[0, 1, 2], [0, 3, 4]])) == 0
