"""Positions of canonical points from the nearest visible pixels, and what a small network adds to them.

Nearest in canonical space: a hidden point follows the cloth it hangs on, not the cloth it lies under. The inverse
distance fill alone puts a hidden layer beside its visible rim; the network has learnt how cloth goes on from there. It
reads the neighbours of one point and a pooled summary of all pixels (PointNet, Qi et al. 2017). All of it happens in
the frame of the garment: turn the garment on the table, and its completion turns with it.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import KDTree
from torch import Tensor, nn

from medor_cloth.nocs import NOCS
from medor_recon.completion.decoder import Decoder
from medor_recon.completion.field import LENGTH_M
from medor_recon.completion.frame import garment_frame
from medor_recon.completion.pixels import Pixels


@dataclass(frozen=True)
class FillConfig:
    """Sizes of the network and what it is fed.

    Attributes:
        neighbours: pixels that each point is filled from.
        softness: distance [m] below which neighbours count alike; 0 makes the fill exact at pixels.
        spacing: of the pixels on the table [m].
        pooled: pixels the summary is made of.
        summary: features of it.
        hidden: widths of the layers after it.
    """

    neighbours: int = 8
    softness: float = 0.005
    spacing: float = 0.008
    pooled: int = 256
    summary: int = 128
    hidden: tuple[int, ...] = (256, 256, 256)


@dataclass(frozen=True, eq=False)
class Filled:
    """Points filled from their neighbours.

    Attributes:
        positions: (Q, 3) float32 world frame [m].
        neighbours: (Q, K) int, the nearest pixels in canonical space, nearest first.
        distances: (Q, K) float32 to them in canonical space [m].
    """

    positions: NDArray[np.float32]
    neighbours: NDArray[np.intp]
    distances: NDArray[np.float32]


def fill(pixels: Pixels, canonical: NDArray[np.floating], neighbours: int = 8, softness: float = 0.0) -> Filled:
    """Inverse squared distance weighting of the nearest pixels' points.

    Args:
        canonical: (Q, 3) canonical space [m].
        softness: see `FillConfig`.
    """
    seen = NOCS[pixels.category].decode(pixels.nocs)
    distances, nearest = KDTree(seen).query(canonical, k=neighbours)
    weights = 1 / (np.maximum(distances, 1e-9) + softness) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    positions = np.einsum("qk,qkx->qx", weights, pixels.points[nearest])
    return Filled(positions.astype(np.float32), np.asarray(nearest), distances.astype(np.float32))


@dataclass(frozen=True, eq=False)
class FillInputs:
    """What the network is fed for Q points of one view, lengths in units of `LENGTH_M`, all float32.

    Attributes:
        summary: (pooled, 7 + categories).
        points: (Q, 7 K + 7 + categories).
        filled: (Q, 3) garment's frame [m].
    """

    summary: NDArray[np.float32]
    points: NDArray[np.float32]
    filled: NDArray[np.float32]


def fill_inputs(
    pixels: Pixels, canonical: NDArray[np.floating], config: FillConfig, categories: tuple[str, ...]
) -> FillInputs:
    """Features of the points and of the view, whose points are in the garment's frame."""
    seen = NOCS[pixels.category].decode(pixels.nocs)
    sure = pixels.confidence.mean(axis=1, keepdims=True)
    filled = fill(pixels, canonical, config.neighbours, config.softness)
    near = filled.neighbours
    around = np.concatenate(
        [
            (seen[near] - canonical[:, None]) / LENGTH_M,
            (pixels.points[near] - filled.positions[:, None]) / LENGTH_M,
            sure[near],
        ],
        axis=2,
    )
    kind = np.array([name == pixels.category for name in categories] if len(categories) > 1 else [], np.float32)
    own = [canonical / LENGTH_M, filled.positions / LENGTH_M, filled.distances[:, :1] / LENGTH_M]
    points = np.concatenate([around.reshape(len(canonical), -1), *own, np.tile(kind, (len(canonical), 1))], axis=1)
    pooled = np.linspace(0, len(seen) - 1, config.pooled).round().astype(int)
    view = [pixels.points[pooled] / LENGTH_M, seen[pooled] / LENGTH_M, sure[pooled]]
    summary = np.concatenate([*view, np.tile(kind, (config.pooled, 1))], axis=1)
    return FillInputs(summary.astype(np.float32), points.astype(np.float32), filled.positions)


class PooledFill(nn.Module):
    """Residual of the fill."""

    def __init__(self, config: FillConfig, categories: tuple[str, ...]) -> None:
        super().__init__()
        self.config, self.categories = config, categories
        kinds = len(categories) if len(categories) > 1 else 0
        self.summary = Decoder(7 + kinds, (64,), config.summary)
        self.residual = Decoder(7 * config.neighbours + 7 + kinds + config.summary, config.hidden, 3)

    def forward(self, summary: Tensor, points: Tensor, filled: Tensor) -> Tensor:
        """Positions (B, Q, 3), garment's frame [m], of a batch of `FillInputs`."""
        pooled = self.summary(summary).amax(dim=1, keepdim=True).expand(-1, points.shape[1], -1)
        return filled + self.residual(torch.cat([points, pooled], dim=2)).float() * LENGTH_M

    def positions(self, pixels: Pixels, canonical: NDArray[np.floating]) -> NDArray[np.float32]:
        """Where canonical points (Q, 3) [m] lie on the table: (Q, 3) world frame [m]."""
        frame = garment_frame(pixels)
        inputs = fill_inputs(frame.view(pixels), canonical, self.config, self.categories)
        device = next(self.parameters()).device
        with torch.inference_mode():
            batch = (torch.from_numpy(part[None]).to(device) for part in (inputs.summary, inputs.points, inputs.filled))
            return frame.outward(self(*batch)[0].cpu().numpy())
