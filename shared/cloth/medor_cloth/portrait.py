"""Portraits of cloth: lit, its two sides told apart, hollows dark, so that people can read the layers."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter

from medor_cloth.camera import Camera
from medor_cloth.raster import Raster, rasterize

FINER = 2
"""Rows and columns rendered for one of the picture."""
OUTSIDE_RGB, INSIDE_RGB = np.array([222.0, 190.0, 146.0]), np.array([128.0, 158.0, 186.0])
TABLE_RGB, LINE_RGB = np.array([46.0, 49.0, 56.0]), np.array([62.0, 66.0, 75.0])
LINES_M, LINE_M = 0.1, 0.0015
"""Distance and width of the lines on the table [m]."""
LIGHT = np.array([-0.5, -0.45, -0.75]) / np.linalg.norm([-0.5, -0.45, -0.75])
"""Direction to the light, camera frame: behind the left shoulder."""
HOLLOW_M, HOLLOW_DEPTH_M, HOLLOW_SHADE = 0.008, 0.012, 0.65
"""A point this much farther away than the mean within the radius loses this share of its light."""


def portrait(
    vertices: NDArray[np.float32], faces: NDArray[np.integer], camera: Camera, *, table: bool = True
) -> NDArray[np.uint8]:
    """(H, W, 3) picture of a mesh (V, 3) [m]: the outer side of its faces warm, the inner side blue.

    Args:
        vertices: World frame.
        faces: (F, 3), wound outwards.
        camera: Where from.
        table: Draw the plane z = 0 with a line every 10 cm; otherwise the mesh floats.
    """
    fine = camera.resized(FINER * camera.width, FINER * camera.height)
    raster = rasterize(vertices, faces, fine)
    ground_rgb, ground_depth = _table(fine) if table else _nothing(fine, raster)
    cloth = raster.mask[..., None]
    rgb = np.where(cloth, _lit(vertices, faces, raster, fine), ground_rgb)
    light = _hollows(np.where(raster.mask, raster.depth, ground_depth), fine)[..., None]
    rgb *= light if table else np.where(cloth, light, 1)
    return np.clip(rgb.reshape(camera.height, FINER, camera.width, FINER, 3).mean((1, 3)), 0, 255).astype(np.uint8)


def captioned(picture: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """The picture with a line of text in its lower left corner."""
    image = Image.fromarray(picture)
    size = max(11, picture.shape[0] // 26)
    ImageDraw.Draw(image).text(
        (size // 2, picture.shape[0] - 1.7 * size), text, (235, 235, 235), ImageFont.load_default(size)
    )
    return np.asarray(image)


def with_arrow(picture: NDArray[np.uint8], move: NDArray[np.float32], camera: Camera) -> NDArray[np.uint8]:
    """A picture with an arrow from pick to place (2, 3) [m]; as it is where there is no move (NaN)."""
    if not np.isfinite(move).all():
        return picture
    (x0, y0), (x1, y1) = camera.project(move)[0]
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    draw.line((x0, y0, x1, y1), fill=(255, 80, 60), width=2)
    draw.ellipse((x0 - 4, y0 - 4, x0 + 4, y0 + 4), outline=(255, 255, 255), width=2)
    draw.ellipse((x1 - 3, y1 - 3, x1 + 3, y1 + 3), fill=(255, 80, 60))
    return np.asarray(image)


def _lit(vertices: NDArray, faces: NDArray, raster: Raster, camera: Camera) -> NDArray:
    """(H, W, 3) colour of the cloth, smooth over its faces; black elsewhere."""
    normals = vertex_normals(vertices, faces) @ camera.T_world_camera[:3, :3]
    corners = faces[raster.face]
    normal = np.einsum("hwk,hwkc->hwc", raster.barycentric, normals[corners])
    seen = camera.to_camera(vertices)
    a, b, c = (seen[corners[..., k]] for k in range(3))
    outside = ((np.cross(b - a, c - a) * a).sum(-1) < 0)[..., None]
    normal *= np.where((normal * a).sum(-1, keepdims=True) < 0, 1, -1)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    light = 0.22 + 0.85 * np.clip(normal @ LIGHT, 0, 1)
    return light[..., None] * np.where(outside, OUTSIDE_RGB, INSIDE_RGB) * raster.mask[..., None]


def vertex_normals(vertices: NDArray, faces: NDArray) -> NDArray:
    """(V, 3) outward unit normals, each the mean over the vertex's faces by area."""
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, k]] for k in range(3))
    across = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    total = np.stack([np.bincount(faces.ravel(), axis, len(vertices)) for axis in across.T], axis=1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def _table(camera: Camera) -> tuple[NDArray, NDArray]:
    """Colour (H, W, 3) and depth (H, W) [m] of the plane z = 0; far away where a ray misses it."""
    rays = camera.rays()
    far = 50 * camera.position[2]
    depth = np.clip(camera.position[2] / np.maximum(-rays[..., 2], 1e-9), 0, far)
    place = camera.position[:2] + rays[..., :2] * depth[..., None]
    offset = np.abs(place / LINES_M - np.round(place / LINES_M)) * LINES_M
    line = (offset < LINE_M / 2).any(-1) & (depth < far)
    return np.where(line[..., None], LINE_RGB, TABLE_RGB), depth


def _nothing(camera: Camera, raster: Raster) -> tuple[NDArray, NDArray]:
    """A plain backdrop just behind the mesh."""
    behind = float(raster.depth.max()) + HOLLOW_DEPTH_M
    return np.broadcast_to(TABLE_RGB, (camera.height, camera.width, 3)), np.full(raster.depth.shape, behind)


def _hollows(depth: NDArray, camera: Camera) -> NDArray:
    """(H, W) share of light left: points farther away than what surrounds them lie in shadow.

    The difference of a depth image and the same image blurred (Luft, Colditz, Deussen 2006).
    """
    radius = HOLLOW_M * camera.K[0, 0] / np.median(depth)
    farther = depth - gaussian_filter(depth, radius, mode="nearest")
    return 1 - HOLLOW_SHADE * np.clip(farther / HOLLOW_DEPTH_M, 0, 1)
