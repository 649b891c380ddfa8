"""Cloth keeps its lengths: what a model foresees is put right after every step, as in position-based dynamics.

A network that errs foresees the mean of what may come, and means lie too close together: after 16 steps edges would be
a tenth too short and some a quarter too long. Nodes give way until mesh edges are as long as before the action again.
Gradients pass through, so a model can be taught with it; where nobody asks for them, a kernel does the same.
"""

import numpy as np
import torch
from torch import Tensor

from medor_cloth.kernel import kernel
from medor_dynamics.graphs import Graphs

OVER_RELAXATION = 1.5
"""Of the mean of what a node's edges ask of it."""
LEAST_SQUARE_M2 = 1e-12
"""A gradient must exist where two nodes meet [m²]."""


def lengths_kept(graphs: Graphs, positions: Tensor, held: Tensor, passes: int) -> Tensor:
    """Nodes (N, 3) [m] moved towards where their mesh edges have rest length again; held ones stay.

    Args:
        graphs: whose edges.
        positions: (N, 3) [m].
        held: (P,) nodes that pickers hold.
        passes: each moves every node by the mean of its edges' corrections, all at once.
    """
    free = positions.new_ones(len(positions)).index_fill(0, held, 0)
    if torch.is_grad_enabled() or positions.device.type != "cpu":
        return _differentiable(graphs, positions, free, passes)
    kept = positions.numpy()
    for _ in range(passes):
        kept = _one_pass(kept, free.numpy(), graphs.mesh_starts, graphs.mesh_senders, graphs.rest.numpy())
    return torch.from_numpy(kept)


def _differentiable(graphs: Graphs, positions: Tensor, free: Tensor, passes: int) -> Tensor:
    senders, receivers, rest = (part.to(positions.device) for part in (graphs.senders, graphs.receivers, graphs.rest))
    # An end that is held leaves all of the way to the other.
    share = free[receivers] / (free[receivers] + free[senders]).clamp(min=1)
    share = share * OVER_RELAXATION / torch.bincount(receivers, minlength=len(positions))[receivers]
    for _ in range(passes):
        offset = positions.index_select(0, senders) - positions.index_select(0, receivers)
        length = offset.square().sum(dim=1).clamp(min=LEAST_SQUARE_M2).sqrt()
        way = offset * (share * (1 - rest / length))[:, None]
        positions = positions.index_add(0, receivers, way)
    return positions


@kernel
def _one_pass(positions, free, mesh_starts, mesh_senders, rest):
    kept = positions.copy()
    for node in range(len(positions)):
        first, last = mesh_starts[node], mesh_starts[node + 1]
        if first == last or free[node] == 0:
            continue
        way_x = way_y = way_z = np.float32(0)
        for slot in range(first, last):
            sender = mesh_senders[slot]
            x = positions[sender, 0] - positions[node, 0]
            y = positions[sender, 1] - positions[node, 1]
            z = positions[sender, 2] - positions[node, 2]
            length = np.sqrt(max(x * x + y * y + z * z, np.float32(LEAST_SQUARE_M2)))
            # An end that is held leaves all of the way to the other.
            part = (np.float32(1) - rest[slot] / length) / (np.float32(1) + free[sender])
            way_x += x * part
            way_y += y * part
            way_z += z * part
        share = np.float32(OVER_RELAXATION) / np.float32(last - first)
        kept[node, 0] += way_x * share
        kept[node, 1] += way_y * share
        kept[node, 2] += way_z * share
    return kept
