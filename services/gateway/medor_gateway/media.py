"""Pictures and meshes as files: 16-bit depth PNG, height-coloured PNG, .glb and .ply."""

import base64
import binascii
import io
import struct

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from medor_cloth.picture import PNG_UNIT_M, depth_from_png16, png16_bytes, png_bytes
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh

LARGEST_SIDE_PX = 4096
FARTHEST_M = 6.5535
"""Largest depth that 16 bits of 0.1 mm hold."""

VISIBLE_RGBA = (66, 133, 214, 255)
OCCLUDED_RGBA = (231, 138, 62, 255)


def encode_depth(depth: NDArray[np.float32]) -> str:
    """Base64 of the 16-bit PNG of a depth image (H, W) [m]; what is farther than it can say becomes 0, not measured."""
    return _base64(png16_bytes(np.where(depth < FARTHEST_M, depth, 0)))


def decode_depth(png: str, unit_m: float = PNG_UNIT_M) -> NDArray[np.float32]:
    """Depth image (H, W) float32 [m] from the base64 of a 16-bit grey PNG whose grey levels are `unit_m` apart.

    Raises:
        BadRequest: not base64, not such a PNG, or too large.
    """
    try:
        return depth_from_png16(_png(png)) * np.float32(unit_m / PNG_UNIT_M)
    except ValueError as error:
        raise BadRequest(str(error)) from error


def encode_mask(mask: NDArray[np.bool_]) -> str:
    """Base64 of a mask (H, W) as 8-bit PNG, 255 on the garment."""
    return _base64(png_bytes(mask.astype(np.uint8) * 255))


def decode_mask(png: str) -> NDArray[np.bool_]:
    """Mask (H, W) from the base64 of an 8-bit or 1-bit grey PNG: what is not black is garment.

    Raises:
        BadRequest: not base64, not such a PNG, or too large.
    """
    try:
        image = Image.open(io.BytesIO(_png(png)), formats=["PNG"])
        pixels = np.asarray(image)
    except (OSError, SyntaxError) as error:
        raise BadRequest(f"expected a PNG file: {error}") from error
    if image.mode not in ("L", "1"):
        raise BadRequest(f"expected a grey PNG of 8 bits or 1, got mode {image.mode!r}")
    return pixels != 0


def mesh_file(mesh: ClothMesh, file_type: str) -> bytes:
    """The mesh as `.ply` (task space: z up) or `.glb` (y up, as glTF wants it); what the camera sees in blue."""
    vertices = mesh.vertices if file_type == "ply" else mesh.vertices[:, [0, 2, 1]] * (1, 1, -1)
    colours = np.where(mesh.visible[:, None], VISIBLE_RGBA, OCCLUDED_RGBA).astype(np.uint8)
    solid = trimesh.Trimesh(vertices, mesh.faces, vertex_colors=colours, process=False)
    content = solid.export(file_type=file_type)
    assert isinstance(content, bytes)
    return content


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _png(text: str) -> bytes:
    """The bytes behind `text`, if its PNG header promises a picture of bearable size."""
    try:
        content = base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise BadRequest(f"expected base64: {error}") from error
    # Width and height stand at a fixed place: a picture that unpacks to gigabytes is refused unopened.
    width, height = struct.unpack(">II", content[16:24]) if len(content) >= 24 else (0, 0)
    if not (0 < width <= LARGEST_SIDE_PX and 0 < height <= LARGEST_SIDE_PX):
        raise BadRequest(f"expected a PNG of at most {LARGEST_SIDE_PX} px a side, got {width} x {height}")
    return content
