"""A shuffled winding is put right, and outwards."""

import numpy as np
import pytest

from medor_cloth.errors import MeshError
from medor_cloth.garment import generate
from medor_cloth.orientation import oriented


def test_randomly_turned_faces_are_found():
    garment = generate("tshirt", 800_001, edge_m=0.02)
    turned = np.random.default_rng(0).random(len(garment.faces)) < 0.5
    faces = np.where(turned[:, None], garment.faces[:, ::-1], garment.faces)
    np.testing.assert_array_equal(oriented(garment.vertices, faces), turned)


def test_an_inside_out_garment_is_turned_as_a_whole():
    garment = generate("skirt", 800_001, edge_m=0.02)
    assert oriented(garment.vertices, garment.faces[:, ::-1]).all()
    assert not oriented(garment.vertices, garment.faces).any()


def test_a_moebius_strip_is_refused():
    n = 12
    angle = np.arange(n) * 2 * np.pi / n
    across = 0.2 * np.column_stack(
        [np.cos(angle / 2) * np.cos(angle), np.cos(angle / 2) * np.sin(angle), np.sin(angle / 2)]
    )
    middle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    i = np.arange(n)
    left, right = i, i + n
    left_next, right_next = (np.where(i == n - 1, s[0], np.roll(t, -1)) for s, t in ((right, left), (left, right)))
    faces = np.vstack([np.column_stack([left, left_next, right]), np.column_stack([left_next, right_next, right])])
    with pytest.raises(MeshError, match="one side"):
        oriented(np.vstack([middle - across, middle + across]), faces)
