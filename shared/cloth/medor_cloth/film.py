"""Cloth in motion as a GIF, or as a strip of pictures."""

import io
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from medor_cloth.camera import Camera
from medor_cloth.picture import png_bytes, shade
from medor_cloth.raster import rasterize


def film(states: Iterable[NDArray[np.float32]], faces: NDArray[np.integer], camera: Camera) -> list[NDArray[np.uint8]]:
    """One picture (H, W, 3) of the lit cloth for each of its states (V, 3) [m]: a rollout, a trajectory, an episode."""
    return [shade(rasterize(state, faces, camera), camera) for state in states]


def gif_bytes(pictures: Sequence[NDArray[np.uint8]], seconds: float = 0.05) -> bytes:
    """A GIF file that shows each picture for some time [s] and starts over.

    Raises:
        ValueError: no picture.
    """
    if not pictures:
        raise ValueError("expected at least one picture")
    first, *rest = (Image.fromarray(picture) for picture in pictures)
    file = io.BytesIO()
    first.save(file, "GIF", save_all=True, append_images=rest, duration=round(1000 * seconds), loop=0)
    return file.getvalue()


def png_strip_bytes(pictures: Sequence[NDArray[np.uint8]]) -> bytes:
    """A PNG file of all pictures side by side."""
    return png_bytes(np.concatenate(pictures, axis=1))
