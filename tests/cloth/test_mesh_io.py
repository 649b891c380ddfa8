"""Users' meshes: what is cloth is read whole, what is not is refused with the reason."""

import io
from functools import cache

import numpy as np
import pytest
import trimesh

from medor_cloth.errors import GarmentError, MeshError
from medor_cloth.garment import Garment, generate
from medor_cloth.mesh_io import load_mesh
from medor_cloth.topology import topology


@cache
def shirt() -> Garment:
    return generate("tshirt", 800_003, edge_m=0.016)


def uv_of(garment: Garment) -> np.ndarray:
    assert garment.panel_uv is not None
    return garment.panel_uv


def obj(vertices, faces, uv=None) -> bytes:
    """An OBJ file; `uv` (F, 3, 2) gives every face corner its own texture vertex."""
    out = io.StringIO()
    np.savetxt(out, vertices, "v %.9g %.9g %.9g")
    if uv is None:
        np.savetxt(out, faces + 1, "f %d %d %d")
    else:
        np.savetxt(out, uv.reshape(-1, 2), "vt %.9g %.9g")
        corners = np.arange(faces.size).reshape(-1, 3) + 1
        both = np.stack([faces + 1, corners], axis=-1).reshape(-1, 6)
        np.savetxt(out, both, "f %d/%d %d/%d %d/%d")
    return out.getvalue().encode()


def face_centres(garment: Garment) -> np.ndarray:
    """(F, 3) sorted, to compare meshes whose vertices are numbered differently."""
    centres = garment.vertices[garment.faces].mean(axis=1)
    return centres[np.lexsort(centres.round(4).T)]


@pytest.mark.parametrize("file_type", ["obj", "ply", "glb"])
def test_every_format_gives_the_same_cloth(file_type):
    mesh = trimesh.Trimesh(shirt().vertices, shirt().faces, process=False)
    content = mesh.export(file_type=file_type)
    content = content.encode() if isinstance(content, str) else bytes(content)
    read = load_mesh(content, "tshirt", file_type)
    assert (read.category, read.seed, read.panel_uv) == ("tshirt", None, None)
    assert (read.vertices.dtype, read.faces.dtype) == (np.float32, np.int32)
    assert topology(read.faces, len(read.vertices)) == topology(shirt().faces, len(shirt().vertices))
    np.testing.assert_allclose(face_centres(read), face_centres(shirt()), atol=1e-5)


def test_panels_in_metres_come_back_corner_by_corner(tmp_path):
    path = tmp_path / "shirt.OBJ"
    path.write_bytes(obj(shirt().vertices, shirt().faces, shirt().panel_uv))
    read = load_mesh(path, "tshirt")
    assert len(read.vertices) == len(shirt().vertices), "vertices split at seams are welded again"
    np.testing.assert_allclose(uv_of(read), uv_of(shirt()), atol=1e-6)
    # vertices are numbered anew, so compare places
    np.testing.assert_allclose(read.vertices[read.faces], shirt().vertices[shirt().faces], atol=1e-6)
    np.testing.assert_allclose(read.laid_flat()[read.faces], shirt().laid_flat()[shirt().faces], atol=1e-4)


@pytest.mark.parametrize("factor", [0.1, 3.0, 1000.0])
def test_texture_coordinates_that_are_not_metres_are_ignored(factor):
    uv = uv_of(shirt())
    read = load_mesh(obj(shirt().vertices, shirt().faces, uv * factor), "tshirt", "obj")
    assert read.panel_uv is None


def test_a_mesh_placed_anywhere_is_centred():
    read = load_mesh(obj(shirt().vertices + (3, -2, 1), shirt().faces), "tshirt", "obj")
    np.testing.assert_allclose(face_centres(read), face_centres(shirt()), atol=1e-5)


def test_winding_is_repaired_and_panels_turn_with_it():
    turned = np.random.default_rng(0).random(len(shirt().faces)) < 0.5
    uv = uv_of(shirt())
    faces = np.where(turned[:, None], shirt().faces[:, ::-1], shirt().faces)
    mixed = np.where(turned[:, None, None], uv[:, ::-1], uv)
    read = load_mesh(obj(shirt().vertices, faces, mixed), "tshirt", "obj")
    np.testing.assert_allclose(read.vertices[read.faces], shirt().vertices[shirt().faces], atol=1e-6)
    np.testing.assert_allclose(uv_of(read), uv, atol=1e-6)


def test_unused_vertices_are_dropped():
    vertices = np.vstack([shirt().vertices, [[9, 9, 9]]])
    assert len(load_mesh(obj(vertices, shirt().faces), "tshirt", "obj").vertices) == len(shirt().vertices)


def refused(vertices, faces, match: str, category: str = "tshirt") -> None:
    with pytest.raises(MeshError, match=match):
        load_mesh(obj(vertices, faces), category, "obj")


def test_sizes_in_other_units_are_refused_with_a_hint():
    refused(shirt().vertices * 1000, shirt().faces, r"in millimetres: scale it by 0\.001")
    refused(shirt().vertices * 100, shirt().faces, r"in centimetres: scale it by 0\.01")
    refused(shirt().vertices / 0.36, shirt().faces, r"full size in metres .*: scale it by 0\.36")
    refused(shirt().vertices * 1e-4, shirt().faces, r"longest side .*e-05 m; expected 0\.1–0\.6 m[^;]*$")


def test_a_third_face_at_an_edge_is_refused():
    a, b, _ = shirt().faces[0]
    vertices = np.vstack([shirt().vertices, [[0, 0, 0]]])
    refused(vertices, np.vstack([shirt().faces, [[a, b, len(vertices) - 1]]]), "more than two faces")


def test_two_pieces_are_refused():
    vertices = np.vstack([shirt().vertices, shirt().vertices + (0, 0, 0.1)]) * 0.7
    refused(vertices, np.vstack([shirt().faces, shirt().faces + len(shirt().vertices)]), "2 separate pieces")


def test_a_closed_surface_is_refused():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.15)
    refused(ball.vertices, ball.faces, "without any opening")


def test_too_coarse_too_fine_and_empty_meshes_are_refused():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.15)
    refused(ball.vertices, ball.faces, r"162 vertices; expected 300–4000 .* subdivide")
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.15)
    refused(ball.vertices, ball.faces, r"10242 vertices; expected 300–4000 .* simplify")
    with pytest.raises(MeshError, match="no faces"):
        load_mesh(b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "tshirt", "obj")


def test_vertices_that_are_not_numbers_are_refused():
    vertices = shirt().vertices.copy()
    vertices[7, 1] = np.nan
    refused(vertices, shirt().faces, "not finite")


def test_nearly_equal_vertices_are_refused():
    vertices, faces = shirt().vertices.copy(), shirt().faces
    vertices[faces[0, 1]] = vertices[faces[0, 0]] + 1e-6
    refused(vertices, faces, "an edge only .* merge vertices")


@pytest.mark.parametrize("file_type", ["obj", "ply", "glb"])
@pytest.mark.parametrize("content", [b"", b"hello", b"\x00" * 64, b"ply\nformat ascii 1.0\n", b"glTF\x02\x00\x00\x00"])
def test_broken_files_are_refused(file_type, content):
    with pytest.raises(MeshError):
        load_mesh(content, "tshirt", file_type)


def test_unknown_types_categories_and_missing_files_are_refused(tmp_path):
    with pytest.raises(MeshError, match=r"obj, ply, glb.*'stl'"):
        load_mesh(b"solid", "tshirt", "stl")
    with pytest.raises(MeshError, match="'none'"):
        load_mesh(b"solid", "tshirt")
    with pytest.raises(MeshError, match="cannot open"):
        load_mesh(tmp_path / "nothing.obj", "tshirt")
    with pytest.raises(GarmentError, match="'hat'"):
        load_mesh(b"", "hat", "obj")
