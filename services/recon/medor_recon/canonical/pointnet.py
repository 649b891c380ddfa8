"""PointNet++: features of a point cloud from nested balls (Qi et al. 2017; GarmentNets, section 3.1)."""

from itertools import pairwise

import numpy as np
import torch
from numba import njit
from scipy.spatial import KDTree
from torch import Tensor, nn

NEIGHBOURS = 64
"""Points of a ball that are looked at, at most."""


def layers(*widths: int) -> nn.Sequential:
    """Linear, ReLU and batch norm from width to width."""
    parts: list[nn.Module] = []
    for before, after in pairwise(widths):
        parts += [nn.Linear(before, after), nn.ReLU(inplace=True), nn.BatchNorm1d(after)]
    return nn.Sequential(*parts)


class Abstraction(nn.Module):
    """Fewer points, each with the greatest features of the ball around it.

    Args:
        share: of the points that stay.
        radius: of the balls [m].
        widths: of the layers, without the three of the offset within a ball.
    """

    def __init__(self, share: float, radius: float, *widths: int) -> None:
        super().__init__()
        self.share, self.radius = share, radius
        self.layers = layers(widths[0] + 3, *widths[1:])

    def forward(self, features: Tensor, cloud: Tensor) -> tuple[Tensor, Tensor]:
        """Features (B, M, C') at M points (B, M, 3) from features (B, N, C) at points (B, N, 3)."""
        points = cloud.detach().cpu().float().numpy()
        count = max(1, round(self.share * points.shape[1]))
        centres = np.stack([farthest_points(cloud, count) for cloud in points])
        balls = np.stack([ball(cloud, at, self.radius) for cloud, at in zip(points, centres, strict=True)])
        kept = _gather(cloud, torch.from_numpy(centres).to(cloud.device))
        members = torch.from_numpy(balls).to(cloud.device)
        offsets = _gather(cloud, members) - kept[:, :, None]
        read = torch.cat([_gather(features, members), offsets.to(features.dtype)], -1)
        return _apply(self.layers, read).amax(2), kept


class Propagation(nn.Module):
    """Features of few points carried back to many, three nearest each, beside what the many know themselves."""

    def __init__(self, *widths: int) -> None:
        super().__init__()
        self.layers = layers(*widths)

    def forward(self, coarse: Tensor, coarse_cloud: Tensor, fine: Tensor, fine_cloud: Tensor) -> Tensor:
        members, weights = zip(*(_nearest(a, b) for a, b in zip(coarse_cloud, fine_cloud, strict=True)), strict=True)
        read = _gather(coarse, torch.stack(members).to(coarse.device))
        carried = (read * torch.stack(weights).to(read)[..., None]).sum(2)
        return _apply(self.layers, torch.cat([carried, fine], -1))


class PointNet(nn.Module):
    """128 features of every point (MEDOR, baselines: GarmentNets)."""

    def __init__(self) -> None:
        super().__init__()
        self.first = Abstraction(0.5, 0.05, 3, 64, 64, 128)
        self.second = Abstraction(0.25, 0.1, 128, 128, 128, 256)
        self.whole = layers(256 + 3, 256, 512, 1024)
        self.from_whole = layers(1024 + 256, 256, 256)
        self.from_second = Propagation(256 + 128, 256, 128)
        self.from_first = Propagation(128 + 3, 128, 128, 128)

    def forward(self, cloud: Tensor, condition: Tensor | None = None) -> Tensor:
        """Features (B, N, 128).

        Args:
            cloud: (B, N, 3) world frame [m], in random order.
            condition: (B, 3) added to what is known of every point at first.
        """
        known = cloud if condition is None else cloud + condition[:, None]
        first, first_cloud = self.first(known, cloud)
        second, second_cloud = self.second(first, first_cloud)
        whole = _apply(self.whole, torch.cat([second, second_cloud.to(second.dtype)], -1)).amax(1, keepdim=True)
        second = _apply(self.from_whole, torch.cat([whole.expand(-1, second.shape[1], -1), second], -1))
        first = self.from_second(second, second_cloud, first, first_cloud)
        return self.from_first(first, first_cloud, known.to(first.dtype), cloud)


@njit(nogil=True, cache=True)
def farthest_points(cloud, count):
    """(count,) int64 points of a cloud (N, 3), each as far as can be from those before it, from the first on."""
    chosen = np.zeros(count, np.int64)
    distance = np.full(len(cloud), np.inf, np.float32)
    for k in range(1, count):
        last, farthest, best = cloud[chosen[k - 1]], 0, np.float32(-1.0)
        for i in range(len(cloud)):
            x, y, z = cloud[i, 0] - last[0], cloud[i, 1] - last[1], cloud[i, 2] - last[2]
            distance[i] = min(distance[i], x * x + y * y + z * z)
            if distance[i] > best:
                best, farthest = distance[i], i
        chosen[k] = farthest
    return chosen


@njit(nogil=True, cache=True)
def ball(cloud, centres, radius, limit=NEIGHBOURS):
    """(M, limit) int64 points within the radius of each of M points of a cloud: the first in order, the centre itself
    in the places that stay free. In a cloud of random order the first are a fair choice."""
    members = np.empty((len(centres), limit), np.int64)
    for m in range(len(centres)):
        centre, found = cloud[centres[m]], 0
        for i in range(len(cloud)):
            x, y, z = cloud[i, 0] - centre[0], cloud[i, 1] - centre[1], cloud[i, 2] - centre[2]
            if x * x + y * y + z * z <= radius * radius:
                members[m, found] = i
                found += 1
                if found == limit:
                    break
        members[m, found:] = centres[m]
    return members


def _nearest(coarse: Tensor, fine: Tensor) -> tuple[Tensor, Tensor]:
    """The three nearest of a cloud (M, 3) to each point (N, 3), and their weights by inverse square distance."""
    count = min(3, len(coarse))
    distance, members = KDTree(coarse.detach().cpu().numpy()).query(fine.detach().cpu().numpy(), count)
    distance, members = distance.reshape(-1, count), members.reshape(-1, count)
    weights = 1 / np.maximum(distance**2, 1e-16)
    return torch.from_numpy(members), torch.from_numpy(weights / weights.sum(1, keepdims=True))


def _gather(values: Tensor, rows: Tensor) -> Tensor:
    """(B, ..., C) rows (B, ...) of values (B, N, C)."""
    flat = rows.flatten(1)[..., None].expand(-1, -1, values.shape[-1])
    return values.gather(1, flat).reshape(*rows.shape, values.shape[-1])


def _apply(module: nn.Module, x: Tensor) -> Tensor:
    """Layers for rows on anything with features last."""
    y = module(x.reshape(-1, x.shape[-1]))
    return y.reshape(*x.shape[:-1], y.shape[-1])
