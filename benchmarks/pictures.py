"""What the camera saw of an episode: the cloth after 0, 1, 3, 5 and the last pick, side by side."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from medor_cloth.picture import depth_picture, png_bytes
from medor_wire.messages import DepthView

MOMENTS = (0, 1, 3, 5)
"""Picks after which the cloth is shown, before the last."""
SIDE_PX = 112
GAP_PX = 3


def path(folder: Path, key: str) -> Path:
    """Where a trial's picture lies in a results folder."""
    return folder / "pictures" / f"{key}.png"


def moments(picks: int) -> list[int]:
    """After how many of an episode's picks the cloth is shown."""
    return [*(moment for moment in MOMENTS if moment < picks), picks]


def strip(views: Sequence[DepthView]) -> bytes:
    """A PNG file of an episode from the views (n,) after 0, 1, … n - 1 picks, height over the table as colour."""
    shots = [_small(views[moment]) for moment in moments(len(views) - 1)]
    gap = np.full((SIDE_PX, GAP_PX, 3), 255, np.uint8)
    parts = [part for shot in shots for part in (gap, shot)]
    return png_bytes(np.concatenate(parts[1:], axis=1))


def _small(view: DepthView) -> NDArray[np.uint8]:
    depth = view.depth if view.mask is None else np.where(view.mask, view.depth, 0)
    whole = depth_picture(depth, table_depth=float(view.camera.T_world_camera[2, 3]))
    side = min(whole.shape[:2])
    top, left = ((size - side) // 2 for size in whole.shape[:2])
    square = Image.fromarray(whole[top : top + side, left : left + side])
    return np.asarray(square.resize((SIDE_PX, SIDE_PX), Image.Resampling.BOX))
