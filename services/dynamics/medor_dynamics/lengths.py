"""Cloth keeps its lengths: what a model foresees is put right after every step, as in position-based dynamics.

A network that errs foresees the mean of what may come, and means lie too close together: after 16 steps edges would be
a tenth too short and some a quarter too long. Nodes give way until mesh edges are as long as before the action again.
Gradients pass through, so a model can be taught with it.
"""

import torch
from torch import Tensor

from medor_dynamics.graphs import Graphs

OVER_RELAXATION = 1.5
"""Of the mean of what a node's edges ask of it."""


def lengths_kept(graphs: Graphs, positions: Tensor, held: Tensor, passes: int) -> Tensor:
    """Nodes (N, 3) [m] moved towards where their mesh edges have rest length again; held ones stay.

    Args:
        graphs: whose edges.
        positions: (N, 3) [m].
        held: (P,) nodes that pickers hold.
        passes: each moves every node by the mean of its edges' corrections, all at once.
    """
    senders, receivers, rest = (part.to(positions.device) for part in (graphs.senders, graphs.receivers, graphs.rest))
    free = positions.new_ones(len(positions)).index_fill(0, held, 0)
    # An end that is held leaves all of the way to the other.
    share = free[receivers] / (free[receivers] + free[senders]).clamp(min=1)
    share = share * OVER_RELAXATION / torch.bincount(receivers, minlength=len(positions))[receivers]
    for _ in range(passes):
        offset = positions.index_select(0, senders) - positions.index_select(0, receivers)
        # A gradient must exist where two nodes meet.
        length = offset.square().sum(dim=1).clamp(min=1e-12).sqrt()
        way = offset * (share * (1 - rest / length))[:, None]
        positions = positions.index_add(0, receivers, way)
    return positions
