"""What a network is fed: heights and mask, or raw depth, or a cloud of points."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

HEIGHT_SCALE = 20.0
"""Heights are centimetres: scaled to numbers around one. Raw depth is the same to 1 % everywhere on a garment."""


def image(height: NDArray[np.float32], mask: NDArray[np.bool_], depth: NDArray[np.float32] | None) -> Tensor:
    """(B, C, H, W) of B views, channels last in memory.

    Args:
        height: (B, H, W) above the table [m], read on the mask only.
        mask: (B, H, W) cloth.
        depth: (B, H, W) [m], for networks that see nothing else; None for the others.
    """
    if depth is not None:
        channels = np.where(mask, depth, 0)[..., None]
    else:
        channels = np.stack([np.where(mask, height * HEIGHT_SCALE, 0), mask], -1)
    return torch.from_numpy(channels.astype(np.float32)).permute(0, 3, 1, 2)


def shares(pixels: NDArray, size: tuple[int, int]) -> Tensor:
    """(B, N, 2) centres of pixels, given by row and column, as shares of the image."""
    return torch.from_numpy(((pixels + 0.5) / np.array(size)).astype(np.float32))
