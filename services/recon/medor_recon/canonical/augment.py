"""What a camera does to a view that the renderer does not: noise, a mount that is a little off, a mask with errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter


@dataclass(frozen=True)
class Augmentation:
    """How far views are changed while a network learns; zero everywhere changes nothing.

    Attributes:
        turn_deg: turned by up to this, either way.
        mirrored: share of the views seen in a mirror: left and right garments are equally common.
        shift_px: the window is off by up to this.
        noise_m: greatest standard deviation of a pixel's depth; each view has its own, down to none.
        offset_m: standard deviation of the camera's height.
        edge: greatest share of the mask's outermost pixels that are lost, and of the table's next to them that are
            taken for cloth.
        holes: greatest share of pixels without a measurement.
    """

    turn_deg: float = 180.0
    mirrored: float = 0.5
    shift_px: float = 8.0
    noise_m: float = 0.001
    offset_m: float = 0.002
    edge: float = 0.3
    holes: float = 0.01


NONE = Augmentation(0, 0, 0, 0, 0, 0, 0)
TURNS = Augmentation(180, 0, 0, 0, 0, 0, 0)
"""As published."""


def measured(
    depth: NDArray[np.float32], table: float, augmentation: Augmentation, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Depth (B, H, W) [m] and mask as a real camera might give them.

    Args:
        depth: (B, H, W) [m] as rendered, 0 off the cloth.
        table: its depth [m].
        augmentation: how far to go.
        rng: of this batch.
    """
    a, views = augmentation, len(depth)
    mask = depth > 0
    if a.edge or a.holes:
        mask = _frayed(mask, a.edge * rng.random((views, 1, 1)), a.holes * rng.random((views, 1, 1)), rng)
    seen = np.where(depth > 0, depth, np.float32(table))
    if a.noise_m or a.offset_m:
        sigma = a.noise_m * rng.random((views, 1, 1), np.float32)
        seen = seen + sigma * rng.standard_normal(depth.shape, np.float32)
        seen = seen + np.float32(a.offset_m) * rng.standard_normal((views, 1, 1), np.float32)
    return np.where(mask, seen, 0).astype(np.float32), mask


def _frayed(mask: NDArray[np.bool_], edge: NDArray, holes: NDArray, rng: np.random.Generator) -> NDArray[np.bool_]:
    inner = np.asarray(minimum_filter(mask, (1, 3, 3), mode="nearest"), bool)
    outer = np.asarray(maximum_filter(mask, (1, 3, 3), mode="nearest"), bool)
    chance = rng.random(mask.shape, np.float32)
    cloth = inner | (mask & (chance > edge)) | (outer & ~mask & (chance < edge))
    return cloth & (chance < 1 - holes)
