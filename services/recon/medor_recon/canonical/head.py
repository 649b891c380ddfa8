"""Coordinates as classes: one of a row of bins for each axis (MEDOR, section 4.1).

Bin b stands for the coordinate b / (bins - 1). A coordinate belongs to the nearest bin; the released code takes the one
below, which pulls every prediction down by half a bin.
"""

from itertools import pairwise
from typing import Literal

import torch
from torch import Tensor, nn

NEIGHBOURS = 3
"""Bins on each side of the most probable that the mean around it counts."""
Decoding = Literal["mean", "mode"]


class Head(nn.Module):
    """Logits (..., 3, bins) of features (..., C).

    Args:
        widths: channels of the features and of each hidden layer.
        bins: of each axis.
        normed: normalise the hidden layers.
        dropout: after each of them.
    """

    def __init__(self, *widths: int, bins: int, normed: bool = False, dropout: float = 0.0) -> None:
        super().__init__()
        self.bins = bins
        hidden = [self._layer(before, after, normed, dropout) for before, after in pairwise(widths)]
        self.layers = nn.Sequential(*hidden, nn.Linear(widths[-1], 3 * bins))

    @staticmethod
    def _layer(before: int, after: int, normed: bool, dropout: float) -> nn.Module:
        norm = nn.BatchNorm1d(after) if normed else nn.Identity()
        return nn.Sequential(nn.Linear(before, after), norm, nn.ReLU(inplace=True), nn.Dropout(dropout))

    def forward(self, features: Tensor) -> Tensor:
        logits = self.layers(features.reshape(-1, features.shape[-1]))
        return logits.reshape(*features.shape[:-1], 3, self.bins)


def to_bins(nocs: Tensor, bins: int) -> Tensor:
    """Class of each coordinate in [0, 1], int64."""
    return (nocs * (bins - 1)).round().long().clamp(0, bins - 1)


def from_bins(classes: Tensor, bins: int) -> Tensor:
    """Coordinate of each class."""
    return classes.float() / (bins - 1)


def decode(logits: Tensor, how: Decoding = "mean") -> tuple[Tensor, Tensor]:
    """Coordinates (..., 3) and the probability (..., 3) of their bins.

    Args:
        logits: (..., 3, bins).
        how: the most probable bin (`mode`), or the mean of the bins around it, weighed by probability (`mean`): finer
            than a bin, and untouched by far-off second opinions.
    """
    probability = logits.float().softmax(-1)
    bins = logits.shape[-1]
    confidence, mode = probability.max(-1)
    if how == "mode":
        return from_bins(mode, bins), confidence
    offsets = torch.arange(-NEIGHBOURS, NEIGHBOURS + 1, device=logits.device)
    around = mode[..., None] + offsets
    inside = (around >= 0) & (around < bins)
    around = around.clamp(0, bins - 1)
    weights = probability.gather(-1, around) * inside
    return (weights * from_bins(around, bins)).sum(-1) / weights.sum(-1), confidence
