"""Analytic sheets as the overhead camera sees them: every pixel's label is known from where it is in the world."""

import numpy as np

from medor_cloth.camera import overhead

CAMERA = overhead(200)


def label(points: np.ndarray) -> np.ndarray:
    """Labels (..., 3) that are a function of the world point: x and y as they are, z from height."""
    return np.stack([0.5 + points[..., 0], 0.5 + points[..., 1], 0.3 + 4 * points[..., 2]], -1)


def view(corner: tuple[int, int], shape: tuple[int, int]) -> dict[str, np.ndarray]:
    """A tilted, wavy sheet that covers a rectangle of the image."""
    mask = np.zeros((200, 200), bool)
    mask[corner[0] : corner[0] + shape[0], corner[1] : corner[1] + shape[1]] = True
    rows, columns = np.indices(mask.shape)
    height = 0.03 + 0.02 * np.sin(rows / 9) * np.cos(columns / 14) + 0.00005 * rows
    depth = np.where(mask, 0.65 - height, 0).astype(np.float32)
    points = np.nan_to_num(CAMERA.back_project(depth))
    return {"depth": depth, "mask": mask, "nocs": np.where(mask[..., None], label(points), 0)}
