"""Pictures of cloth for people, and depth images as PNG files."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, UnidentifiedImageError

from medor_cloth.camera import HEIGHT_M, Camera

if TYPE_CHECKING:
    from medor_cloth.raster import Raster

PNG_UNIT_M = 1e-4
"""One grey level of a depth PNG [m]."""

_TABLE_RGB = (38, 40, 46)
_CLOTH_RGB = np.array([214.0, 188.0, 150.0])
_LIGHT = np.array([-0.45, 0.35, 0.82])
# Height above the table as a fraction of the highest -> colour, dark to bright so that it survives printing.
_HEIGHT_STOPS = np.array([0.0, 0.15, 0.4, 0.7, 1.0])
_HEIGHT_RGB = np.array([[44, 24, 102], [52, 92, 168], [46, 160, 140], [180, 210, 70], [255, 240, 160]])


def shade(raster: Raster, camera: Camera) -> np.ndarray:
    """(H, W, 3) uint8: the cloth lit from one side; folds and the edges of layers stand out."""
    points = camera.back_project(raster.depth).astype(np.float64)
    across, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normal = np.cross(down, across)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    # The outermost pixels have no neighbour to slope against: they are lit as if they faced the camera.
    normal = np.where(np.isfinite(normal), normal, -camera.T_world_camera[:3, 2])
    light = 0.25 + 0.75 * np.clip(normal @ (_LIGHT / np.linalg.norm(_LIGHT)), 0, 1)
    return _on_table(light[..., None] * _CLOTH_RGB, raster.mask)


def depth_picture(depth: np.ndarray, table_depth: float = HEIGHT_M, highest: float = 0.06) -> np.ndarray:
    """(H, W, 3) uint8: height above the table as colour, so that layers can be told apart.

    Args:
        depth: (H, W) [m], 0 where nothing was measured.
        table_depth: depth of the table [m].
        highest: height [m] from which on the colour stays the same.
    """
    height = np.clip((table_depth - depth) / highest, 0, 1)
    rgb = np.stack([np.interp(height, _HEIGHT_STOPS, channel) for channel in _HEIGHT_RGB.T], axis=-1)
    return _on_table(rgb, depth > 0)


def _on_table(rgb: np.ndarray, mask: np.ndarray) -> np.ndarray:
    return np.where(mask[..., None], np.clip(rgb, 0, 255), _TABLE_RGB).astype(np.uint8)


def png_bytes(rgb: np.ndarray) -> bytes:
    """A PNG file of an (H, W, 3) uint8 picture."""
    return _png(np.asarray(rgb, np.uint8))


def png16_bytes(depth: np.ndarray) -> bytes:
    """A 16-bit grey PNG file of a depth image (H, W) [m] in units of 0.1 mm, up to 6.5535 m.

    Raises:
        ValueError: a depth that is negative, not finite or too large to be stored.
    """
    levels = np.round(np.asarray(depth, np.float64) / PNG_UNIT_M)
    if not ((levels >= 0) & (levels <= 65535)).all():
        raise ValueError(f"expected depths from 0 to {65535 * PNG_UNIT_M} m")
    return _png(levels.astype(np.uint16))


def depth_from_png16(png: bytes) -> np.ndarray:
    """(H, W) float32 depth [m] from a 16-bit grey PNG file in units of 0.1 mm.

    Raises:
        ValueError: not a PNG file, or not a 16-bit grey one.
    """
    try:
        image = Image.open(io.BytesIO(png), formats=["PNG"])
        levels = np.asarray(image)
    except (UnidentifiedImageError, OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"expected a PNG file: {error}") from error
    if levels.ndim != 2 or not image.mode.startswith("I;16"):
        raise ValueError(f"expected a 16-bit grey PNG, got mode {image.mode!r} of shape {levels.shape}")
    return (levels * PNG_UNIT_M).astype(np.float32)


def _png(pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()
