"""3D U-Net that completes a sparse volume of features (Çiçek et al. 2016; MEDOR, section III-B).

Two convolutions a level, each GroupNorm, 3 × 3 × 3 convolution without bias, ReLU; max pooling down, nearest
neighbours and concatenation up, a last 1 × 1 × 1 convolution.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional as F

GROUPS = 8


class UNet3d(nn.Module):
    """(B, inputs, G, G, G) → (B, outputs, G, G, G).

    Args:
        maps: Feature maps of the finest level; every coarser one has twice as many.
        levels: Resolutions, the input's included; G must be a multiple of 2^(levels − 1).
    """

    def __init__(self, inputs: int, outputs: int, maps: int = 32, levels: int = 4) -> None:
        super().__init__()
        widths = [maps << level for level in range(levels)]
        self.down = nn.ModuleList(
            _block(before, max(width // 2, before), width)
            for before, width in zip([inputs, *widths[:-1]], widths, strict=True)
        )
        self.up = nn.ModuleList(
            _block(coarse + fine, fine, fine) for coarse, fine in zip(widths[:0:-1], widths[-2::-1], strict=True)
        )
        self.last = nn.Conv3d(maps, outputs, 1)

    def forward(self, volume: Tensor) -> Tensor:
        levels = [self.down[0](volume)]
        for block in self.down[1:]:
            levels.append(block(F.max_pool3d(levels[-1], 2)))
        volume = levels.pop()
        for block in self.up:
            fine = levels.pop()
            volume = block(torch.cat([fine, F.interpolate(volume, size=fine.shape[2:])], dim=1))
        return self.last(volume)


def _block(inputs: int, middle: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(*_convolution(inputs, middle), *_convolution(middle, outputs))


def _convolution(inputs: int, outputs: int) -> list[nn.Module]:
    groups = GROUPS if inputs % GROUPS == 0 else 1
    return [nn.GroupNorm(groups, inputs), nn.Conv3d(inputs, outputs, 3, padding=1, bias=False), nn.ReLU()]
