"""The paper's completion: visible features in a volume, a 3D U-Net, and two fields read from it (MEDOR, section III-B).

The winding-number field says where the garment's surface runs in canonical space, the warp field where a canonical
point lies on the table.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from medor_cloth.nocs import NOCS
from medor_recon.completion.decoder import Decoder
from medor_recon.completion.frame import WORLD, Frame, garment_frame, laid_flat
from medor_recon.completion.pixels import Pixels
from medor_recon.completion.scatter import nearest_node, sample, scatter_max
from medor_recon.completion.unet3d import UNet3d

LENGTH_M = 0.1
"""Lengths in metres are divided by this before a network sees them, to be of order one."""


@dataclass(frozen=True)
class FieldConfig:
    """Sizes of the network and what it learns.

    Attributes:
        features: of the canonicaliser, per pixel; 9 geometric ones are added.
        aggregation: widths of the layers from these to the volume's input.
        grid: nodes along each side of the volume; a multiple of 2^(levels − 1).
        maps, levels: of the U-Net.
        volume_features: of the completed volume.
        decoder: hidden widths of both decoders.
        batch_norm: in aggregation and decoders.
        relative: the warp is added to the canonical point; False for GarmentNets and the ablation `no-relative`.
        framed: the table is seen from the garment's frame, and the warp starts from the garment laid flat in it;
            otherwise both are as published: world frame, and the canonical point as it stands.
        position_weight: of the squared position error [1/m²] beside that of the winding number.
        nodes: along each side, of the grid the surface is taken from.
    """

    features: int = 480
    aggregation: tuple[int, ...] = (489, 128)
    grid: int = 32
    maps: int = 32
    levels: int = 4
    volume_features: int = 128
    decoder: tuple[int, ...] = (256, 256)
    batch_norm: bool = True
    relative: bool = True
    framed: bool = False
    position_weight: float = 1.0
    nodes: int = 128


class Field(nn.Module):
    """Tensors in, tensors out.

    Args:
        categories: it knows; with more than one the category is one more input of every pixel, one-hot.
    """

    def __init__(self, config: FieldConfig, categories: tuple[str, ...]) -> None:
        super().__init__()
        self.config, self.categories = config, categories
        kinds = len(categories) if len(categories) > 1 else 0
        self.aggregate = _aggregation(config.features + 9 + kinds, config.aggregation, config.batch_norm)
        unet = UNet3d(config.aggregation[-1], config.volume_features, config.maps, config.levels)
        self.unet = unet.to(memory_format=torch.channels_last_3d)  # type: ignore[call-overload]
        self.to_winding = Decoder(config.volume_features, config.decoder, 1, config.batch_norm)
        self.to_position = Decoder(config.volume_features + 3, config.decoder, 3, config.batch_norm)

    def frame(self, view: Pixels) -> Frame:
        """The frame that a view is to be given in, and positions come in."""
        return garment_frame(view) if self.config.framed else WORLD

    def volume(self, views: list[Pixels]) -> Tensor:
        """Completed features (B, C, G, G, G), indexed [x, y, z], of B views in their `frame`."""
        device = next(self.parameters()).device
        points = torch.cat([self._inputs(view, device) for view in views])
        nocs = torch.cat([torch.as_tensor(view.nocs, device=device) for view in views])
        item = torch.repeat_interleave(
            torch.arange(len(views), device=device), torch.tensor([len(view.nocs) for view in views], device=device)
        )
        gathered = scatter_max(self.aggregate(points), nocs, item, len(views), self.config.grid)
        return self.unet(gathered.contiguous(memory_format=torch.channels_last_3d)).float()

    def winding(self, volume: Tensor, queries: Tensor) -> Tensor:
        """Winding number (B, Q) at points (B, Q, 3) of the NOCS cube."""
        return self.to_winding(sample(volume, queries))[..., 0].float()

    def positions(self, volume: Tensor, queries: Tensor, canonical: Tensor) -> Tensor:
        """Where canonical points lie on the table (B, Q, 3), in the view's `frame` [m].

        Args:
            queries: (B, Q, 3) in the NOCS cube.
            canonical: (B, Q, 3) the same points in metres.
        """
        warp = self.to_position(torch.cat([sample(volume, queries), canonical / LENGTH_M], dim=-1)).float() * LENGTH_M
        if not self.config.relative:
            return warp
        return warp + (laid_flat(canonical) if self.config.framed else canonical)

    def warp(self, pixels: Pixels, canonical: NDArray[np.float32]) -> NDArray[np.float32]:
        """Where canonical points (Q, 3) [m] of the garment in a view lie on the table (Q, 3), world frame [m]."""
        with torch.inference_mode():
            return self.warp_in(self.volume([self.frame(pixels).view(pixels)]), pixels, canonical)

    def warp_in(self, volume: Tensor, pixels: Pixels, canonical: NDArray[np.float32]) -> NDArray[np.float32]:
        """The same from the view's completed volume (1, C, G, G, G)."""
        with torch.inference_mode():
            queries = torch.from_numpy(NOCS[pixels.category].encode(canonical))[None].to(volume.device)
            found = self.positions(volume, queries, torch.from_numpy(canonical)[None].to(volume.device))
            return self.frame(pixels).outward(found[0].cpu().numpy())

    def _inputs(self, view: Pixels, device: torch.device) -> Tensor:
        """Inputs of a view's pixels (P, features + 9 + categories): features, offset to the node, point, confidence."""
        nocs = torch.as_tensor(view.nocs, device=device)
        offset = nocs * (self.config.grid - 1) - nearest_node(nocs, self.config.grid)
        point = torch.as_tensor(view.points, device=device) / LENGTH_M
        parts = [offset, point, torch.as_tensor(view.confidence, device=device)]
        if self.config.features:
            parts.append(torch.as_tensor(view.features, device=device))
        if len(self.categories) > 1:
            parts.append(one_hot(view.category, self.categories, len(nocs), device))
        return torch.cat(parts, dim=1)


def one_hot(category: str, categories: tuple[str, ...], rows: int, device: torch.device) -> Tensor:
    """(rows, categories) float, the same in each row."""
    kind = torch.tensor([name == category for name in categories], dtype=torch.float32, device=device)
    return kind.expand(rows, -1)


def _aggregation(inputs: int, widths: tuple[int, ...], batch_norm: bool) -> nn.Sequential:
    layers: list[nn.Module] = []
    for width in widths:
        layers += [nn.Linear(inputs, width), nn.ReLU()]
        if batch_norm:
            layers.append(nn.BatchNorm1d(width))
        inputs = width
    return nn.Sequential(*layers)
