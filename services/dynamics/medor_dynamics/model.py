"""The dynamics model: from cloth and the picker's move to the cloth one step later (MEDOR, dynamics model)."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Self

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from medor_dynamics.graphs import Graphs, Wiring
from medor_dynamics.lean import LeanNetwork
from medor_dynamics.lengths import lengths_kept
from medor_dynamics.network import GraphNetwork
from medor_dynamics.normalizer import Normalizer
from medor_dynamics.preset import HISTORY, STEP_S, Preset


@dataclass(frozen=True, eq=False)
class Motion:
    """Where nodes are and how they came there.

    Attributes:
        positions: (N, 3) [m].
        velocities: (N, 5, 3) over the past steps, newest first [m/s].
    """

    positions: Tensor
    velocities: Tensor

    @classmethod
    def resting(cls, positions: Tensor) -> Self:
        """Nodes that lie still."""
        return cls(positions, positions.new_zeros(len(positions), HISTORY, 3))


@dataclass(frozen=True, eq=False)
class Grip:
    """What pickers do in one step: nodes (P,) they hold, and displacement (P, 3) [m] by which these move."""

    nodes: Tensor
    displacement: Tensor

    @property
    def velocity(self) -> Tensor:
        return self.displacement / STEP_S


class Dynamics(nn.Module):
    """A graph network with its normalizer: what is learnt."""

    def __init__(self, preset: Preset) -> None:
        super().__init__()
        self.preset = preset
        self.network = GraphNetwork(preset)
        self.normalizer = Normalizer()

    def forward(self, graphs: Graphs, motion: Motion, grip: Grip) -> Motion:
        """The nodes one step later."""
        return Predictor(self.preset, self.normalizer, self.network)(graphs, motion, grip)

    @property
    def device(self) -> torch.device:
        return self.normalizer.node_scale.device

    def predictor(self, dtype: torch.dtype = torch.float32) -> "Predictor":
        """The model as it is now, made ready for rollouts on its device, hidden values in a precision."""
        on_cpu = self.device.type == "cpu"
        network = LeanNetwork(self.network, dtype) if on_cpu else deepcopy(self.network).to(dtype)
        return Predictor(self.preset, self.normalizer, network, dtype)


@dataclass(frozen=True, eq=False)
class Predictor:
    """One step of cloth: features in, the network's accelerations integrated."""

    preset: Preset
    normalizer: Normalizer
    network: Callable[[Tensor, Tensor, Wiring], Tensor]
    dtype: torch.dtype = torch.float32

    def __call__(self, graphs: Graphs, motion: Motion, grip: Grip) -> Motion:
        """The nodes one step later. A held node moves exactly as its picker does."""
        moved = injected(motion, grip)
        after = integrated(moved, self.acceleration(graphs, moved, grip), grip)
        if not self.preset.length_passes:
            return after
        kept = lengths_kept(graphs, after.positions, grip.nodes, self.preset.length_passes)
        velocity = (kept - motion.positions) / STEP_S
        return Motion(kept, torch.cat([velocity[:, None], after.velocities[:, 1:]], dim=1))

    def acceleration(self, graphs: Graphs, moved: Motion, grip: Grip) -> Tensor:
        """(N, 3) acceleration [m/s²] of nodes among which the held ones have been moved."""
        wiring = graphs.wire(moved.positions, self.preset)
        nodes = self.normalizer.nodes(node_features(moved, grip))
        edges = self.normalizer.edges(edge_features(moved.positions, wiring))
        out = self.network(nodes.to(self.dtype), edges.to(self.dtype), wiring)
        return out.float() * self.normalizer.acceleration_scale


def injected(motion: Motion, grip: Grip) -> Motion:
    """The action before the network looks: held nodes are moved, and their newest velocity is the picker's."""
    if not len(grip.nodes):
        return motion
    velocities = motion.velocities[grip.nodes]
    imposed = torch.cat([grip.velocity[:, None], velocities[:, :-1]], dim=1)
    return Motion(
        motion.positions.index_add(0, grip.nodes, grip.displacement),
        motion.velocities.index_copy(0, grip.nodes, imposed),
    )


def integrated(moved: Motion, acceleration: Tensor, grip: Grip) -> Motion:
    """Semi-implicit Euler for the free nodes; held nodes are where the action has put them."""
    velocity = moved.velocities[:, 0] + acceleration * STEP_S
    positions = moved.positions + velocity * STEP_S
    velocities = torch.cat([velocity[:, None], moved.velocities[:, :-1]], dim=1)
    if not len(grip.nodes):
        return Motion(positions, velocities)
    return Motion(
        positions.index_copy(0, grip.nodes, moved.positions[grip.nodes]),
        velocities.index_copy(0, grip.nodes, moved.velocities[grip.nodes]),
    )


def node_features(moved: Motion, grip: Grip) -> Tensor:
    """(N, 18): five velocities, newest first, height, not held or held. Where a node is in the plane is not told."""
    held = torch.zeros(len(moved.positions), dtype=torch.long, device=moved.positions.device)
    held[grip.nodes] = 1
    return torch.cat([moved.velocities.flatten(1), moved.positions[:, 2:], F.one_hot(held, 2)], dim=1)


def edge_features(positions: Tensor, wiring: Wiring) -> Tensor:
    """(E, 7): offset from sender to receiver, its length, stretch of a mesh edge, collision edge or mesh edge."""
    offset = positions.index_select(0, wiring.receivers) - positions.index_select(0, wiring.senders)
    # A gradient must exist where two nodes meet.
    distance = offset.square().sum(dim=1).clamp(min=1e-12).sqrt()
    stretch = (distance - wiring.rest) * wiring.mesh
    flat = torch.stack([distance, stretch, 1 - wiring.mesh, wiring.mesh], dim=1)
    return torch.cat([offset, flat], dim=1)
