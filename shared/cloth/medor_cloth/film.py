"""Cloth in motion as a GIF, or as a sheet of pictures."""

import io
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from medor_cloth.camera import Camera
from medor_cloth.picture import png_bytes
from medor_cloth.portrait import portrait


def film(states: Iterable[NDArray[np.float32]], faces: NDArray[np.integer], camera: Camera) -> list[NDArray[np.uint8]]:
    """One picture (H, W, 3) of the cloth for each of its states (V, 3) [m]: a rollout, a trajectory, an episode."""
    return [portrait(state, faces, camera) for state in states]


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


def png_sheet_bytes(pictures: Sequence[NDArray[np.uint8]]) -> bytes:
    """A PNG file of all pictures (H, W, 3), row by row, about as wide as high."""
    height, width = pictures[0].shape[:2]
    columns = int(np.ceil(np.sqrt(len(pictures) * height / width)))
    blank = [np.full_like(pictures[0], pictures[0][-1, -1])] * (-len(pictures) % columns)
    rows = np.array([*pictures, *blank]).reshape(-1, columns, height, width, 3)
    return png_bytes(rows.transpose(0, 2, 1, 3, 4).reshape(-1, columns * width, 3))
