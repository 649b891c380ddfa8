"""Coordinates as classes: one of a row of bins for each axis (MEDOR, section 4.1).

Bin b stands for the coordinate b / (bins - 1). A coordinate belongs to the nearest bin; the released code takes the one
below, which pulls every prediction down by half a bin.
"""

from typing import Literal

import torch
from torch import Tensor, nn

NEIGHBOURS = 3
"""Bins on each side of the most probable that the mean around it counts."""
Decoding = Literal["mean", "mode"]


class Head(nn.Module):
    """Logits (..., 3, bins) of features (..., C)."""

    def __init__(self, channels: int, hidden: int, bins: int, normed: bool, dropout: float = 0.0) -> None:
        super().__init__()
        self.bins = bins
        self.hidden = nn.Linear(channels, hidden)
        self.norm = nn.BatchNorm1d(hidden) if normed else nn.Identity()
        self.dropout = nn.Dropout(dropout)
        self.last = nn.Linear(hidden, 3 * bins)

    def forward(self, features: Tensor) -> Tensor:
        flat = features.reshape(-1, features.shape[-1])
        logits = self.last(self.dropout(torch.relu(self.norm(self.hidden(flat)))))
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
