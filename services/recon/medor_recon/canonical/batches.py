"""Batches of views as a network is fed them."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from medor_cloth.camera import HEIGHT_M, overhead
from medor_cloth.dataset import STORED
from medor_recon.canonical import inputs
from medor_recon.canonical.augment import Augmentation, measured
from medor_recon.canonical.preset import Preset
from medor_recon.canonical.views import SIDE_PX, Views
from medor_recon.canonical.windows import Placement, turned_centres, windows

FOCAL_PX = float(overhead(SIDE_PX).K[0, 0])


@dataclass(frozen=True, eq=False)
class Batch:
    """B views and N pixels of each.

    Attributes:
        seen: the arguments of the network, before the category.
        category: (B,) numbers.
        nocs: (B, N, 3) labels.
        points: (B, N, 3) float32 where the pixels are in the turned world [m], as rendered.
    """

    seen: tuple[Tensor, ...]
    category: Tensor
    nocs: Tensor
    points: NDArray[np.float32]

    def to(self, device: torch.device) -> "Batch":
        moved = tuple(part.to(device) for part in self.seen)
        return Batch(moved, self.category.to(device), self.nocs.to(device), self.points)


def draw(
    views: Views, rows: NDArray[np.int64], preset: Preset, augmentation: Augmentation, rng: np.random.Generator
) -> Batch:
    """Some views, changed at random, and pixels of each drawn at random."""
    placement = _placed(views.centre[rows], preset, augmentation, rng)
    chances = rng.random((len(rows), preset.pixels))
    levels, pixels, labels = windows(views, rows, placement, chances)
    rendered = levels * np.float32(STORED["depth"].unit)
    depth, mask = measured(rendered, HEIGHT_M, augmentation, rng)
    points = _world(rendered, pixels, placement)
    if preset.network == "pointnet":
        seen = (torch.from_numpy(_world(np.where(mask, depth, rendered), pixels, placement)),)
    else:
        image = inputs.image(HEIGHT_M - depth, mask, None if preset.heights else depth)
        seen = (image, inputs.shares(pixels, (preset.size, preset.size)))
    nocs = labels * np.float32(STORED["nocs"].unit)
    return Batch(seen, torch.from_numpy(views.category[rows]), torch.from_numpy(nocs), points)


def _placed(centre: NDArray, preset: Preset, a: Augmentation, rng: np.random.Generator) -> Placement:
    count = len(centre)
    angle = np.radians(a.turn_deg) * rng.uniform(-1, 1, count)
    mirrored = rng.random(count) < a.mirrored
    if preset.view == "whole":
        return Placement(angle, mirrored, np.zeros((count, 2)), SIDE_PX / preset.size, preset.size)
    shift = a.shift_px * rng.uniform(-1, 1, (count, 2))
    origin = np.round(turned_centres(centre, angle, mirrored) + shift - preset.size / 2)
    return Placement(angle, mirrored, origin, 1.0, preset.size)


def _world(depth: NDArray[np.float32], pixels: NDArray[np.int32], placement: Placement) -> NDArray[np.float32]:
    """(B, N, 3) what the overhead camera sees at pixels of windows of its (turned) image."""
    rows, columns = np.moveaxis(pixels, -1, 0)
    z = depth[np.arange(len(depth))[:, None], rows, columns]
    uv = placement.origin[:, None] + (np.stack([columns, rows], -1) + 0.5) * placement.scale - SIDE_PX / 2
    xy = uv * (1, -1) * (z[..., None] / FOCAL_PX)
    return np.concatenate([xy, HEIGHT_M - z[..., None]], -1).astype(np.float32)
