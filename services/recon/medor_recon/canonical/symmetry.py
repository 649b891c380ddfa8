"""Which canonical coordinates are as right as the labelled ones, or cannot be told from them in one view.

A garment that is the same after a turn about its body axis (the z axis of canonical space) has several right answers,
and a shirt, which is not, shows its front and its back so much alike that a network taught to tell them apart learns
nothing else. So a view is compared with the garment turned in every such way, and the turn that fits best counts.
"""

import math

import numpy as np
import torch
from torch import Tensor

from medor_cloth.garment import SYMMETRY_ORDER
from medor_recon.canonical.head import to_bins

HALF_TURNS = 2
"""Least number of turns that are allowed for: front and back."""


def turns(category: str) -> int:
    """How many turns of a category are compared with."""
    return max(SYMMETRY_ORDER[category], HALF_TURNS)


def sides(category: str) -> int:
    """How many of them differ in truth: the turns that are no symmetry of the garment."""
    return turns(category) // SYMMETRY_ORDER[category]


def rotations(category: str, device: torch.device | str = "cpu") -> Tensor:
    """(K, 3, 3) the turns about the body axis, the first of them none; turn k · order leads to another side."""
    angles = torch.arange(turns(category), dtype=torch.float64) * (2 * math.pi / turns(category))
    cos, sin, zero, one = angles.cos(), angles.sin(), torch.zeros_like(angles), torch.ones_like(angles)
    matrices = torch.stack([cos, -sin, zero, sin, cos, zero, zero, zero, one], -1).reshape(-1, 3, 3)
    return matrices.float().to(device)


def turned(nocs: Tensor, matrices: Tensor) -> Tensor:
    """(K, ..., 3) coordinates (..., 3) in the cube turned about its middle by K matrices."""
    shape = (len(matrices), *[1] * (nocs.ndim - 1), 3, 3)
    # Not a matrix product: autocast would round coordinates to a quarter of a bin.
    return (matrices.view(shape) * (nocs - 0.5)[..., None, :]).sum(-1) + 0.5


def turned_points(nocs: np.ndarray, category: str, turn: int) -> np.ndarray:
    """(P, 3) float32 coordinates in the cube after one of the turns of a category."""
    return turned(torch.from_numpy(nocs), rotations(category)[turn : turn + 1])[0].numpy()


def cross_entropy(logits: Tensor, nocs: Tensor, matrices: Tensor) -> tuple[Tensor, Tensor]:
    """Loss of each view (B,), averaged over pixels and axes, and the turn (B,) that fits it best.

    Only the best turn is differentiated.

    Args:
        logits: (B, N, 3, bins).
        nocs: (B, N, 3) labels.
        matrices: (K, 3, 3) turns to compare with; one alone makes this the plain cross-entropy.
    """
    log_probability = logits.float().log_softmax(-1)
    classes = to_bins(turned(nocs, matrices), logits.shape[-1])  # (K, B, N, 3)
    with torch.no_grad():
        spread = log_probability.expand(len(matrices), *log_probability.shape)
        best = -spread.gather(-1, classes[..., None]).mean((-3, -2, -1))  # (K, B)
        turn = best.argmin(0)
    chosen = classes[turn, torch.arange(len(turn), device=turn.device)]
    return -log_probability.gather(-1, chosen[..., None]).mean((-3, -2, -1)), turn
