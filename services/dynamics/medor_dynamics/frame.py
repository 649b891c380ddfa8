"""The axes a model thinks in: the world's, or those with x along the pull."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.alignment import rotation
from medor_dynamics.preset import Preset


def headings(pulls: NDArray, preset: Preset) -> NDArray[np.float64]:
    """(K,) angle of the model's x axis in the world, about z [rad], for pulls (K, 3). A vertical pull has none: 0."""
    if preset.frame == "world":
        return np.zeros(len(pulls))
    return np.arctan2(pulls[:, 1], pulls[:, 0], dtype=np.float64)


def turned(points: NDArray, angles: NDArray[np.float64]) -> NDArray[np.float32]:
    """Points (K, n, 3), or (n, 3) for all alike, turned about z by angles (K,): (K, n, 3)."""
    xy = np.asarray(points, np.float64)[..., :2] @ np.swapaxes(rotation(angles), -1, -2)
    z = np.broadcast_to(points[..., 2:], (*xy.shape[:-1], 1))
    return np.concatenate([xy, z], axis=-1).astype(np.float32)
