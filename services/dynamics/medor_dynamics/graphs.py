"""Graphs of a batch: what stays the same while cloth moves, and the edges of a moment."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from medor_dynamics.neighbors import NO_SLOT, edges_of
from medor_dynamics.preset import Preset

FAR_M = 1e3
"""Where nodes without a place are looked for [m]."""


@dataclass(frozen=True, eq=False)
class Wiring:
    """Edges of a moment, sorted by receiver.

    Attributes:
        senders: (E,) int64.
        receivers: (E,) int64.
        rest: (E,) float32 rest length of a mesh edge [m], 0 for a collision edge.
        mesh: (E,) float32, 1 for a mesh edge, 0 for a collision edge.
        graph_of: (N,) int64 graph of each node.
        graphs: their number.
    """

    senders: Tensor
    receivers: Tensor
    rest: Tensor
    mesh: Tensor
    graph_of: Tensor
    graphs: int


@dataclass(frozen=True, eq=False)
class Graphs:
    """B graphs as one: the nodes of each follow those of the one before.

    Attributes:
        starts: (B + 1,) first node of each graph, and the number of nodes N.
        mesh_starts: (N + 1,) first mesh edge into each node, and the number of mesh edges M.
        mesh_senders: (M,) sender of each mesh edge; every edge of the mesh is there in both directions.
        rest: (M,) float32 rest lengths [m].
        graph_of: (N,) graph of each node.
    """

    starts: NDArray[np.int64]
    mesh_starts: NDArray[np.int64]
    mesh_senders: NDArray[np.int64]
    rest: Tensor
    graph_of: Tensor

    @cached_property
    def senders(self) -> Tensor:
        """(M,) of the mesh edges, sorted by receiver."""
        return torch.from_numpy(self.mesh_senders)

    @cached_property
    def receivers(self) -> Tensor:
        """(M,) of the mesh edges."""
        return torch.from_numpy(np.repeat(np.arange(self.starts[-1]), np.diff(self.mesh_starts)))

    @classmethod
    def of(cls, sizes: Sequence[int], edges: Sequence[NDArray], rest: Sequence[NDArray]) -> Self:
        """One graph per mesh, of n nodes each, (e, 2) undirected edges and (e,) rest lengths."""
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        both = [np.concatenate([pair, pair[:, ::-1]]) + first for pair, first in zip(edges, starts, strict=False)]
        pairs = np.concatenate(both).astype(np.int64)
        order = np.lexsort((pairs[:, 0], pairs[:, 1]))
        senders, receivers = pairs[order].T
        lengths = np.concatenate([np.tile(each, 2) for each in rest]).astype(np.float32)[order]
        counts = np.bincount(receivers, minlength=starts[-1])
        return cls(
            starts=starts,
            mesh_starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            mesh_senders=np.ascontiguousarray(senders),
            rest=torch.from_numpy(lengths),
            graph_of=torch.from_numpy(np.repeat(np.arange(len(sizes)), sizes)),
        )

    def repeated(self, times: int) -> "Graphs":
        """The same graphs several times over."""
        nodes, edges, graphs = self.starts[-1], self.mesh_starts[-1], len(self)
        again = np.arange(times, dtype=np.int64)[:, None]
        return Graphs(
            starts=np.append((self.starts[:-1] + again * nodes).ravel(), times * nodes),
            mesh_starts=np.append((self.mesh_starts[:-1] + again * edges).ravel(), times * edges),
            mesh_senders=(self.mesh_senders + again * nodes).ravel(),
            rest=self.rest.repeat(times),
            graph_of=(self.graph_of + graphs * torch.from_numpy(again)).ravel(),
        )

    def __len__(self) -> int:
        return len(self.starts) - 1

    def wire(self, positions: Tensor, preset: Preset) -> Wiring:
        """The edges for nodes that lie at positions (N, 3) [m]. The search itself runs on the CPU.

        A graph whose nodes left the finite numbers has edges too, though of no meaning: the others must go on.
        """
        device = positions.device
        senders, receivers, slots = edges_of(
            positions.detach().nan_to_num().clamp(-FAR_M, FAR_M).cpu().numpy(),
            self.starts,
            self.mesh_starts,
            self.mesh_senders,
            radius=preset.radius_m,
            nearest=preset.nearest,
            close_mesh_edges=preset.close_mesh_edges,
        )
        slot = torch.from_numpy(slots)
        mesh = (slot != NO_SLOT).float()
        return Wiring(
            senders=torch.from_numpy(senders).to(device),
            receivers=torch.from_numpy(receivers).to(device),
            rest=(self.rest[slot.clamp(min=0)] * mesh).to(device),
            mesh=mesh.to(device),
            graph_of=self.graph_of.to(device),
            graphs=len(self),
        )
