"""What was seen, thought and made of some observations, side by side."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from medor_cloth.camera import overhead
from medor_cloth.picture import depth_picture, shade
from medor_cloth.raster import rasterize
from medor_recon.canonicalized import Canonicalized
from medor_recon.evaluate.stages import Stages
from medor_recon.methods import Method
from medor_wire.errors import ReconstructionFailed

CAMERA = overhead(200)
HEADS = ("depth", "true canonical", "predicted", "completed", "finetuned", "truth")
GAP_PX = 4
HEAD_PX = 16
TABLE_RGB = (38, 40, 46)


def row(stages: Stages, method: Method) -> list[NDArray[np.uint8]]:
    """Pictures (H, W, 3) under `HEADS` of one observation; empty ones from where the method failed."""
    observed = stages.observed
    faces = observed.garment.faces
    own = observed.garment.vertices
    box = observed.trajectory.garment.box.encode(own)
    low, high = box.min(axis=0), box.max(axis=0)
    pictures = [depth_picture(observed.depth), _colours(observed.truth, low, high)]
    try:
        pictures.append(_colours(stages.canonicalized(method), low, high))
        completed = stages.completed(method)
        pictures.append(_lit(completed.positions, completed.faces))
        pictures.append(_lit(stages.refined(method).positions, completed.faces))
    except ReconstructionFailed:
        blank = np.full((CAMERA.height, CAMERA.width, 3), TABLE_RGB, np.uint8)
        pictures += [blank] * (len(HEADS) - 1 - len(pictures))
    return [*pictures, _lit(observed.positions, faces)]


def sheet(rows: list[list[NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """The rows as one picture with headings."""
    picture = np.concatenate([np.concatenate([_padded(one) for one in pictures], axis=1) for pictures in rows])
    canvas = Image.new("RGB", (picture.shape[1], picture.shape[0] + HEAD_PX), TABLE_RGB)
    canvas.paste(Image.fromarray(picture), (0, HEAD_PX))
    draw = ImageDraw.Draw(canvas)
    for column, head in enumerate(HEADS):
        draw.text((column * (CAMERA.width + GAP_PX) + GAP_PX, 2), head, fill=(230, 230, 230))
    return np.asarray(canvas)


def _colours(seen: Canonicalized, low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Canonical coordinates as red, green and blue, from end to end of the true garment."""
    picture = np.full((CAMERA.height, CAMERA.width, 3), TABLE_RGB, np.uint8)
    column, row = np.clip(CAMERA.project(seen.points)[0].astype(int), 0, CAMERA.width - 1).T
    picture[row, column] = np.rint(255 * np.clip((seen.nocs - low) / (high - low), 0, 1)).astype(np.uint8)
    return picture


def _lit(positions: NDArray[np.floating], faces: NDArray[np.int32]) -> NDArray[np.uint8]:
    return shade(rasterize(positions, faces, CAMERA), CAMERA)


def _padded(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.pad(picture, ((0, GAP_PX), (0, GAP_PX), (0, 0)), constant_values=20)
