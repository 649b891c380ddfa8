"""Networks from a view to logits of canonical coordinates, whatever they see of it."""

from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from medor_recon.canonical.head import Head
from medor_recon.canonical.hrnet import HRNet
from medor_recon.canonical.pointnet import PointNet
from medor_recon.canonical.preset import Preset
from medor_recon.canonical.sampling import sample
from medor_recon.canonical.symmetry import HALF_TURNS

SIDE_HIDDEN = 64
"""Channels of the side head."""
CERTAIN = 10.0
"""Logit of a side that is not in question."""
POINTNET_DROPOUT = 0.5


class Prediction(NamedTuple):
    """What a network says of N pixels of each of B views."""

    logits: Tensor
    """(B, N, 3, bins)."""
    features: Tensor
    """(B, N, C)."""
    side: Tensor
    """(B, 2) logits: are the coordinates right as they are, or after half a turn about the body axis?"""


class Side(nn.Module):
    """One opinion of a view from the features of its pixels."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.hidden = nn.Linear(channels, SIDE_HIDDEN)
        self.last = nn.Linear(SIDE_HIDDEN, HALF_TURNS)

    def forward(self, features: Tensor) -> Tensor:
        return self.last(torch.relu(self.hidden(features)).mean(1))


class NoSide(nn.Module):
    """What a network says that was not taught sides: coordinates are right as they are."""

    def forward(self, features: Tensor) -> Tensor:
        return features.new_tensor([CERTAIN, 0.0]).expand(len(features), HALF_TURNS)


class ImageNetwork(nn.Module):
    """HRNet and a head.

    Args:
        preset: its choices.
        categories: how many it is taught at once; more than one are told apart by a learnt vector.
    """

    def __init__(self, preset: Preset, categories: int = 1) -> None:
        super().__init__()
        self.on_map = preset.head == "map"
        inputs = 2 if preset.heights else 1
        self.backbone = HRNet(
            inputs, preset.width, preset.modules, preset.blocks, preset.bottlenecks, preset.stem, preset.norm
        )
        self.head = Head(preset.channels, preset.hidden, bins=preset.bins, normed=preset.head_norm)
        self.side = Side(preset.channels) if preset.side else NoSide()
        self.category = nn.Embedding(categories, preset.stem) if categories > 1 else None

    def forward(self, image: Tensor, points: Tensor, category: Tensor) -> Prediction:
        """What is seen at some points of images.

        Args:
            image: (B, inputs, H, W).
            points: (B, N, 2) row and column as shares of the image.
            category: (B,) number of the garment's category.
        """
        maps = self.backbone(image, self.category(category) if self.category else None)
        logits, features = self._on_map(maps, points) if self.on_map else self._on_pixels(maps, points)
        return Prediction(logits, features, self.side(features))

    def _on_map(self, maps: list[Tensor], points: Tensor) -> tuple[Tensor, Tensor]:
        size = maps[0].shape[-2:]
        resized = [F.interpolate(x, size=size, mode="bilinear", align_corners=False) for x in maps[1:]]
        features = torch.cat([maps[0], *resized], 1)
        logits = self.head(features.permute(0, 2, 3, 1)).flatten(3).permute(0, 3, 1, 2)
        read = sample(logits, points, corners=True)
        return read.reshape(*points.shape[:2], 3, -1), sample(features, points)

    def _on_pixels(self, maps: list[Tensor], points: Tensor) -> tuple[Tensor, Tensor]:
        features = torch.cat([sample(x, points) for x in maps], -1)
        return self.head(features), features


class PointNetwork(nn.Module):
    """PointNet++ and a head."""

    def __init__(self, preset: Preset, categories: int = 1) -> None:
        super().__init__()
        self.backbone = PointNet()
        self.head = Head(preset.channels, preset.hidden, preset.hidden, bins=preset.bins, dropout=POINTNET_DROPOUT)
        self.side = Side(preset.channels) if preset.side else NoSide()
        self.category = nn.Embedding(categories, 3) if categories > 1 else None

    def forward(self, cloud: Tensor, category: Tensor) -> Prediction:
        """What is seen at world points (B, N, 3) [m]."""
        features = self.backbone(cloud, self.category(category) if self.category else None)
        return Prediction(self.head(features), features, self.side(features))


def build(config: dict[str, Any]) -> nn.Module:
    """The network of a config of weights, with random weights."""
    preset = Preset.from_json(config["preset"])
    network = ImageNetwork if preset.network == "hrnet" else PointNetwork
    module = network(preset, len(config["categories"]))
    return module.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
