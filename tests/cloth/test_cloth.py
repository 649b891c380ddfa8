import numpy as np
import pytest

from medor_cloth.cloth import Cloth
from medor_cloth.errors import MeshError
from medor_cloth.garment import generate
from tests.cloth.sheets import EDGE_M, sheet


def test_a_sheet_has_the_edges_euler_counts_and_each_once():
    vertices, faces = sheet(5, 7)
    cloth = Cloth.from_mesh(vertices, faces)
    assert len(cloth.edges) == len(vertices) + len(faces) - 1
    assert len({frozenset(pair) for pair in cloth.edges.tolist()}) == len(cloth.edges)


def test_the_rest_shape_of_a_mesh_without_panels_is_the_mesh():
    vertices, faces = sheet(5, 7)
    cloth = Cloth.from_mesh(vertices, faces)
    lengths = np.linalg.norm(vertices[cloth.edges[:, 0]] - vertices[cloth.edges[:, 1]], axis=1)
    np.testing.assert_allclose(cloth.rest_lengths, lengths, rtol=1e-6)


def test_bending_rests_where_the_two_faces_of_an_edge_lie_flat_even_if_the_mesh_is_folded():
    vertices, faces = sheet(6, 4)
    folded = vertices.copy()
    right = vertices[:, 0] > 3 * EDGE_M
    folded[right] = np.stack([np.full(right.sum(), 3 * EDGE_M), vertices[right, 1], vertices[right, 0] - 3 * EDGE_M], 1)
    flat, bent = Cloth.from_mesh(vertices, faces), Cloth.from_mesh(folded, faces)
    np.testing.assert_array_equal(flat.bend.pairs, bent.bend.pairs)
    np.testing.assert_allclose(flat.bend.rest_lengths, bent.bend.rest_lengths, rtol=1e-5)


def test_panels_give_the_rest_lengths_corner_by_corner():
    vertices, faces = sheet(4, 4)
    panels = vertices[faces][..., :2]
    moved = panels + np.array([0.3, -0.1])
    wide = Cloth.from_mesh(vertices, faces, 2 * moved)
    np.testing.assert_allclose(wide.rest_lengths, 2 * Cloth.from_mesh(vertices, faces).rest_lengths, rtol=1e-5)


@pytest.mark.parametrize("apart", [0.0, 0.5])
def test_a_seam_between_two_panels_does_not_bend(apart: float):
    vertices, faces = sheet(6, 4)
    panels = vertices[faces][..., :2].copy()
    back = vertices[faces][..., 0].min(1) >= 3 * EDGE_M - 1e-6
    panels[back, :, 0] = 6 * EDGE_M - panels[back, :, 0] + apart  # the right half folded under, or drawn elsewhere
    cloth = Cloth.from_mesh(vertices, faces, panels)
    sides = np.sign(np.round(vertices[cloth.bend.pairs][..., 0] / EDGE_M - 3))
    assert not ((sides[:, 0] * sides[:, 1]) < 0).any()
    whole = Cloth.from_mesh(vertices, faces)
    assert len(whole.bend.pairs) - len(cloth.bend.pairs) == 4


def test_springs_of_one_colour_share_no_vertex():
    garment = generate("tshirt", 800001, edge_m=0.02)
    cloth = Cloth.from_mesh(garment.vertices, garment.faces, garment.panel_uv)
    for springs in (cloth.stretch, cloth.bend):
        assert springs.colours[0] == 0
        assert springs.colours[-1] == len(springs.pairs)
        for start, end in zip(springs.colours[:-1], springs.colours[1:], strict=True):
            vertices = springs.pairs[start:end].ravel()
            assert len(np.unique(vertices)) == len(vertices)


def test_across_names_the_apex_of_the_neighbouring_face():
    cloth = Cloth.from_mesh(*sheet(1, 1))
    for face, across in zip(cloth.faces, cloth.across, strict=True):
        assert set(across[across >= 0]) == set(range(4)) - set(face)


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], "expected vertices"),
        (np.eye(3), [[0, 1, 3]], "name vertices"),
        (np.zeros((3, 3)), [[0, 1, 2]], "without area"),
    ],
)
def test_meshes_that_are_none_are_refused(vertices, faces, message):
    with pytest.raises(MeshError, match=message):
        Cloth.from_mesh(vertices, np.array(faces))


def test_panels_of_another_mesh_are_refused():
    vertices, faces = sheet(2, 2)
    with pytest.raises(MeshError, match="panel_uv"):
        Cloth.from_mesh(vertices, faces, np.zeros((3, 3, 2), np.float32))
