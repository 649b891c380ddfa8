"""Features of single points gathered in a volume over the NOCS cube (MEDOR, section III-B).

A volume of G³ cells has one node a cell, node (i, j, k) at (i, j, k) / (G − 1): the first and the last lie on the
cube's faces. Volumes are indexed [x, y, z] everywhere; whoever reads one (`sample`) has to turn the axes for torch.
Points belong to their nearest node. The released code takes the node below and reads volumes with x and z exchanged.
"""

import torch
from torch import Tensor
from torch.nn import functional as F


def nearest_node(nocs: Tensor, grid: int) -> Tensor:
    """Node (..., 3) long, in x, y, z, nearest to coordinates (..., 3) in the NOCS cube."""
    return (nocs * (grid - 1)).round().long().clamp(0, grid - 1)


def scatter_max(features: Tensor, nocs: Tensor, item: Tensor, items: int, grid: int) -> Tensor:
    """Largest feature of the points of each cell, 0 in cells without points.

    Args:
        features: (P, C) of all points of all items.
        nocs: (P, 3) their coordinates in the NOCS cube.
        item: (P,) long, which item of the batch a point belongs to.

    Returns:
        (items, C, grid, grid, grid), indexed [x, y, z].
    """
    node = nearest_node(nocs, grid)
    cell = ((item * grid + node[:, 0]) * grid + node[:, 1]) * grid + node[:, 2]
    cells = features.new_zeros(items * grid**3, features.shape[1])
    cells = cells.scatter_reduce(0, cell[:, None].expand_as(features), features, "amax", include_self=False)
    return cells.view(items, grid, grid, grid, -1).permute(0, 4, 1, 2, 3)


def sample(volume: Tensor, queries: Tensor) -> Tensor:
    """A volume between its nodes, trilinear.

    Args:
        volume: (B, C, G, G, G) indexed [x, y, z].
        queries: (B, Q, 3) x, y, z in the NOCS cube; outside it the border's value.

    Returns:
        (B, Q, C).
    """
    last_axis_first = queries.flip(-1) * 2 - 1
    grid = last_axis_first[:, :, None, None].float()
    read = F.grid_sample(volume.float(), grid, align_corners=True, padding_mode="border")
    return read[..., 0, 0].transpose(1, 2)


def nodes_of(grid: int) -> Tensor:
    """(grid³, 3) coordinates of all nodes, in the order of a volume's flattened [x, y, z]."""
    line = torch.linspace(0, 1, grid)
    return torch.cartesian_prod(line, line, line)
