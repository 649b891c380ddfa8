import base64
import io
import struct
import zlib

import numpy as np
import pytest
import trimesh
from PIL import Image

from medor_gateway.media import decode_depth, decode_mask, encode_depth, encode_mask, mesh_file
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh

RNG = np.random.default_rng(3)


def png(pixels: np.ndarray) -> str:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode()


def test_depth_survives_to_half_a_step() -> None:
    depth = RNG.uniform(0, 6.5, (7, 5)).astype(np.float32)
    assert np.abs(decode_depth(encode_depth(depth)) - depth).max() <= 0.5e-4 + 1e-6


def test_not_measured_stays_not_measured_and_too_far_becomes_it() -> None:
    depth = np.array([[0.0, 0.65, 7.0]], np.float32)
    assert decode_depth(encode_depth(depth)).tolist() == [[0.0, pytest.approx(0.65), 0.0]]


def test_a_camera_that_counts_in_millimetres_can_say_so() -> None:
    levels = np.array([[650, 0]], np.uint16)
    assert decode_depth(png(levels), unit_m=0.001).tolist() == [[pytest.approx(0.65), 0.0]]


def test_a_mask_survives() -> None:
    mask = RNG.random((6, 9)) > 0.5
    assert (decode_mask(encode_mask(mask)) == mask).all()
    assert (decode_mask(png(mask)) == mask).all(), "1-bit PNG"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "not base64!",
        base64.b64encode(b"not a PNG").decode(),
        base64.b64encode(b"\x89PNG\r\n\x1a\n" + bytes(40)).decode(),
        png(np.zeros((3, 3, 3), np.uint8)),
        encode_depth(np.ones((40, 40), np.float32))[:80],
    ],
)
def test_what_is_no_depth_image_is_a_bad_request(text: str) -> None:
    with pytest.raises(BadRequest, match="expected"):
        decode_depth(text)
    with pytest.raises(BadRequest, match="expected"):
        decode_mask(text)


def test_a_small_file_that_unpacks_to_gigabytes_is_refused_unopened() -> None:
    header = struct.pack(">IIBBBBB", 60000, 60000, 16, 0, 0, 0, 0)
    chunk = b"IHDR" + header
    bomb = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
    with pytest.raises(BadRequest, match="60000 x 60000"):
        decode_depth(base64.b64encode(bomb).decode())


@pytest.fixture
def mesh() -> ClothMesh:
    return ClothMesh(
        vertices=RNG.normal(size=(5, 3)).astype(np.float32),
        faces=np.array([[0, 1, 2], [2, 3, 4]], np.int32),
        category="dress",
        visible=np.array([True, True, False, True, False]),
    )


def test_ply_keeps_the_task_space(mesh: ClothMesh) -> None:
    read = trimesh.load_mesh(io.BytesIO(mesh_file(mesh, "ply")), file_type="ply", process=False)
    assert np.allclose(read.vertices, mesh.vertices)
    assert (read.faces == mesh.faces).all()


def test_glb_stands_upright_without_being_mirrored(mesh: ClothMesh) -> None:
    read = trimesh.load_mesh(io.BytesIO(mesh_file(mesh, "glb")), file_type="glb", process=False)
    y_up = np.array(read.vertices)
    assert np.allclose(y_up[:, 1], mesh.vertices[:, 2], atol=1e-6)
    volume = np.linalg.det(mesh.vertices[1:4] - mesh.vertices[0])
    assert np.linalg.det(y_up[1:4] - y_up[0]) == pytest.approx(volume, rel=1e-4)


def test_colours_tell_what_the_camera_saw(mesh: ClothMesh) -> None:
    read = trimesh.load_mesh(io.BytesIO(mesh_file(mesh, "ply")), file_type="ply", process=False)
    given = read.visual.vertex_colors  # pyright: ignore[reportAttributeAccessIssue, reportOptionalMemberAccess]
    colours = {tuple(colour) for colour in given[mesh.visible]}
    hidden = {tuple(colour) for colour in given[~mesh.visible]}
    assert len(colours) == len(hidden) == 1
    assert colours != hidden
