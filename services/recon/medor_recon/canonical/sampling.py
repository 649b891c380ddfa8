"""Feature maps read at points between their cells."""

import torch
from torch import Tensor
from torch.nn import functional as F


def sample(features: Tensor, points: Tensor, corners: bool = False) -> Tensor:
    """(B, N, C) features at points by bilinear interpolation, as if the map had been resized to the whole image.

    Args:
        features: (B, C, h, w).
        points: (B, N, 2) row and column as shares of the image; (0.5 / H, 0.5 / W) is the centre of the first of
            H × W pixels.
        corners: align the centres of the corner cells with those of the corner pixels of an image four times the size
            (torch's `align_corners`) instead of the edges of map and image.
    """
    batch, channels, height, width = features.shape
    size = torch.tensor([height, width], dtype=points.dtype, device=points.device)
    at = (points * 4 * size - 0.5) * (size - 1) / (4 * size - 1) if corners else points * size - 0.5
    at = at.clamp(min=torch.zeros_like(size), max=size - 1)
    low = at.floor().minimum((size - 2).clamp(min=0))
    share = at - low
    high = (low + 1).minimum(size - 1)
    rows, columns = torch.stack([low, high], -1).long().unbind(-2)  # (B, N, 2) each
    first = torch.arange(batch, device=points.device)[:, None, None, None] * (height * width)
    cells = first + rows[..., :, None] * width + columns[..., None, :]
    shares = torch.stack([1 - share, share], -1)
    weights = shares[..., 0, :, None] * shares[..., 1, None, :]  # (B, N, 2, 2)
    table = features.permute(0, 2, 3, 1).reshape(-1, channels)
    read = F.embedding(cells.flatten(), table).reshape(*points.shape[:2], 4, channels)
    return (read * weights.flatten(-2)[..., None].to(read.dtype)).sum(2)
