"""HRNet: branches of several resolutions side by side, exchanging features (Sun et al. 2019; MEDOR, section 4.1)."""

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional as F

GROUP = 8
"""Channels of a group when norms are over groups."""


def norm(kind: str, channels: int) -> nn.Module:
    """A normalisation layer by name."""
    return nn.BatchNorm2d(channels) if kind == "batch" else nn.GroupNorm(max(channels // GROUP, 1), channels)


def convolution(kind: str, before: int, after: int, kernel: int = 3, stride: int = 1, relu: bool = True) -> nn.Module:
    """Convolution, normalisation and, if wanted, ReLU."""
    layers = [nn.Conv2d(before, after, kernel, stride, kernel // 2, bias=False), norm(kind, after)]
    return nn.Sequential(*layers, nn.ReLU(inplace=True)) if relu else nn.Sequential(*layers)


class Residual(nn.Module):
    """A body whose result is added to its input, or to a projection of it."""

    def __init__(self, body: nn.Module, shortcut: nn.Module | None = None) -> None:
        super().__init__()
        self.body = body
        self.shortcut = shortcut or nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(self.body(x) + self.shortcut(x), inplace=True)


def basic(kind: str, channels: int) -> Residual:
    """Two 3 × 3 convolutions."""
    return Residual(
        nn.Sequential(convolution(kind, channels, channels), convolution(kind, channels, channels, relu=False))
    )


def bottleneck(kind: str, before: int, inner: int) -> Residual:
    """1 × 1, 3 × 3, 1 × 1 up to four times the inner channels."""
    after = 4 * inner
    body = nn.Sequential(
        convolution(kind, before, inner, 1),
        convolution(kind, inner, inner),
        convolution(kind, inner, after, 1, relu=False),
    )
    return Residual(body, None if before == after else convolution(kind, before, after, 1, relu=False))


class Exchange(nn.Module):
    """Every branch becomes the sum of all, each brought to its resolution."""

    def __init__(self, kind: str, channels: Sequence[int]) -> None:
        super().__init__()
        self.paths = nn.ModuleList(
            nn.ModuleList(self._path(kind, channels, source, target) for source in range(len(channels)))
            for target in range(len(channels))
        )

    @staticmethod
    def _path(kind: str, channels: Sequence[int], source: int, target: int) -> nn.Module:
        if source == target:
            return nn.Identity()
        if source > target:
            return convolution(kind, channels[source], channels[target], 1, relu=False)
        widths = [channels[source]] * (target - source) + [channels[target]]
        steps = list(pairwise(widths))
        return nn.Sequential(
            *(convolution(kind, a, b, stride=2, relu=k < len(steps) - 1) for k, (a, b) in enumerate(steps))
        )

    def forward(self, maps: list[Tensor]) -> list[Tensor]:
        return [F.relu(self._sum(paths, maps, x.shape[-2:])) for paths, x in zip(self.paths, maps, strict=True)]  # type: ignore[arg-type]

    @staticmethod
    def _sum(paths: nn.ModuleList, maps: list[Tensor], size: torch.Size) -> Tensor:
        total = None
        for path, x in zip(paths, maps, strict=True):
            y = path(x)
            y = y if y.shape[-2:] == size else F.interpolate(y, size=size)
            total = y if total is None else total + y
        assert total is not None
        return total


class Module(nn.Module):
    """Residual blocks on every branch, then an exchange."""

    def __init__(self, kind: str, channels: Sequence[int], blocks: int) -> None:
        super().__init__()
        self.branches = nn.ModuleList(nn.Sequential(*(basic(kind, c) for _ in range(blocks))) for c in channels)
        self.exchange = Exchange(kind, channels)

    def forward(self, maps: list[Tensor]) -> list[Tensor]:
        return self.exchange([branch(x) for branch, x in zip(self.branches, maps, strict=True)])


class Stage(nn.Module):
    """One branch more, made of the coarsest, then modules."""

    def __init__(self, kind: str, before: int, channels: Sequence[int], modules: int, blocks: int) -> None:
        super().__init__()
        self.finer = convolution(kind, before, channels[0]) if len(channels) == 2 else None
        self.coarser = convolution(kind, before, channels[-1], stride=2)
        self.modules_ = nn.ModuleList(Module(kind, channels, blocks) for _ in range(modules))

    def forward(self, maps: list[Tensor]) -> list[Tensor]:
        coarser = self.coarser(maps[-1])
        maps = [*(maps if self.finer is None else [self.finer(maps[-1])]), coarser]
        for module in self.modules_:
            maps = module(maps)
        return maps


class HRNet(nn.Module):
    """Feature maps of an image at 1/4, 1/8, 1/16 … of its resolution.

    Args:
        inputs: channels of the image.
        width: channels of the finest branch, doubled from branch to branch.
        modules: of each stage from the second.
        blocks: of each branch of a module.
        bottlenecks: of the first stage; 0 leaves it out.
        stem: channels of the stem.
        kind: of the norms.
    """

    def __init__(
        self, inputs: int, width: int, modules: Sequence[int], blocks: int, bottlenecks: int, stem: int, kind: str
    ) -> None:
        super().__init__()
        self.stem = nn.Sequential(convolution(kind, inputs, stem, stride=2), convolution(kind, stem, stem, stride=2))
        self.stage1 = nn.Sequential(*(bottleneck(kind, stem if k == 0 else 4 * stem, stem) for k in range(bottlenecks)))
        before = 4 * stem if bottlenecks else stem
        stages = []
        for k, count in enumerate(modules):
            channels = [width * 2**branch for branch in range(k + 2)]
            stages.append(Stage(kind, before if k == 0 else channels[-2], channels, count, blocks))
        self.stages = nn.ModuleList(stages)

    def forward(self, image: Tensor, condition: Tensor | None = None) -> list[Tensor]:
        """Maps (B, width · 2ᵏ, H / 2ᵏ⁺², W / 2ᵏ⁺²) of an image (B, inputs, H, W).

        Args:
            image: in.
            condition: (B, stem) added to what the stem says of every pixel.
        """
        x = self.stem(image)
        if condition is not None:
            x = x + condition[:, :, None, None].to(x.dtype)
        maps = [self.stage1(x)]
        for stage in self.stages:
            maps = stage(maps)
        return maps
