"""Recorded pulls as a model sees them, and batches of them to learn from (MEDOR, section 5.2).

Records are a model step apart and the pull ends on one of them, so no step straddles the release.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from medor_cloth.cluster import Clustered
from medor_cloth.dataset import Dataset, GarmentRecord, Trajectory
from medor_dynamics.frame import headings, turned
from medor_dynamics.graphs import Graphs
from medor_dynamics.model import Grip, Motion
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.preset import HISTORY, PULL_STEPS, STEP_S, STEPS, Preset


@dataclass(frozen=True, eq=False)
class Recording:
    """A pull and the fall after it, in the axes of a model.

    Attributes:
        category: of the garment.
        positions: (17, n, 3) nodes before the action and after every step [m].
        edges: (e, 2) undirected mesh edges.
        rest: (e,) their rest lengths [m].
        node: the one held.
        step: (3,) displacement of the picker in a step of the pull [m].
    """

    category: str
    positions: NDArray[np.float32]
    edges: NDArray[np.int32]
    rest: NDArray[np.float32]
    node: int
    step: NDArray[np.float32]

    def mirrored(self) -> "Recording":
        """The same in a mirror along x: cloth knows no left and right."""
        mirror = np.array([1, -1, 1], np.float32)
        return replace(self, positions=self.positions * mirror, step=self.step * mirror)

    def turned(self, angle: float) -> "Recording":
        """The same turned about z [rad]."""
        angles = np.array([angle])
        return replace(self, positions=turned(self.positions, angles), step=turned(self.step[None], angles)[0, 0])

    def before(self, first: int) -> NDArray[np.float32]:
        """(6, n, 3) positions up to record `first`, oldest first; before the action the cloth lies still."""
        return self.positions[np.maximum(np.arange(first - HISTORY, first + 1), 0)]


def recordings(dataset: Dataset, preset: Preset, *, visible_only: bool = False) -> list[Recording]:
    """All pulls of a data set. With `visible_only` the camera's view of the cloth is all there is of it."""
    return [each for record in dataset.garments for each in recordings_of(record, preset, visible_only)]


def recordings_of(record: GarmentRecord, preset: Preset, visible_only: bool) -> list[Recording]:
    nodes = Clustered(ids=record["node_ids"], faces=np.empty((0, 3), np.int32), edges=record["node_edges"])
    mesh = NodeMesh.over(record.garment.vertices, nodes)
    return [recording(each, mesh, preset, visible_only) for each in record.trajectories()]


def recording(trajectory: Trajectory, mesh: NodeMesh, preset: Preset, visible_only: bool = False) -> Recording:
    """One trajectory. The node held is the one that stands for the vertex held."""
    positions = trajectory["positions"][:, mesh.ids]
    pick, place = trajectory["move"]
    back = -headings((place - pick)[None], preset)
    whole = Recording(
        category=trajectory.garment.category,
        positions=turned(positions, back),
        edges=mesh.edges,
        rest=mesh.rest_lengths(positions[0], preset),
        node=mesh.node_of(int(trajectory["grasp"][1])),
        step=turned((place - pick)[None] / PULL_STEPS, back)[0, 0],
    )
    return seen(whole, trajectory["visible"]) if visible_only else whole


def seen(whole: Recording, visible: NDArray[np.bool_]) -> Recording:
    """The part of a recording whose nodes (n,) the camera saw before the pull, and the node held."""
    keep = visible.copy()
    keep[whole.node] = True
    number = np.cumsum(keep) - 1
    both = keep[whole.edges].all(axis=1)
    return replace(
        whole,
        positions=whole.positions[:, keep],
        edges=number[whole.edges[both]].astype(np.int32),
        rest=whole.rest[both],
        node=int(number[whole.node]),
    )


@dataclass(frozen=True, eq=False)
class Batch:
    """A few stretches of recordings: where they begin, what the pickers do, where the nodes should be.

    Attributes:
        graphs: of the meshes.
        motion: at the beginning.
        grips: of each of S steps.
        targets: (S, N, 3) positions after each step [m].
    """

    graphs: Graphs
    motion: Motion
    grips: list[Grip]
    targets: Tensor

    def to(self, device: torch.device) -> "Batch":
        """The same on a device."""
        motion = Motion(self.motion.positions.to(device), self.motion.velocities.to(device))
        grips = [Grip(grip.nodes.to(device), grip.displacement.to(device)) for grip in self.grips]
        return Batch(self.graphs, motion, grips, self.targets.to(device))


@dataclass(frozen=True)
class Sampler:
    """Draws batches of stretches."""

    recordings: Sequence[Recording]
    size: int = 8
    """Graphs in a batch."""
    steps: int = 1
    """Length of a stretch."""
    noise: float = 0.0
    """Spread of the newest velocity's error after a random walk over the history (GNS) [m/s]."""
    mirror: bool = False
    """Show half of the stretches in a mirror."""
    turn: bool = False
    """Turn each stretch by a random angle. Has no point in the pull's frame."""
    seed: int = field(default=0, kw_only=True)

    def draw(self, step: int) -> Batch:
        """The batch of a training step; it depends on the seed and the step alone."""
        rng = np.random.default_rng([self.seed, step])
        chosen = [self.recordings[index] for index in rng.integers(len(self.recordings), size=self.size)]
        firsts = rng.integers(STEPS - self.steps + 1, size=self.size)
        chosen = [self._seen_otherwise(each, rng) for each in chosen]
        windows = [self._disturbed(each, int(first), rng) for each, first in zip(chosen, firsts, strict=True)]
        return stretches(chosen, firsts, windows, self.steps)

    def _seen_otherwise(self, recording: Recording, rng: np.random.Generator) -> Recording:
        if self.mirror and rng.random() < 0.5:
            recording = recording.mirrored()
        return recording.turned(rng.uniform(0, 2 * np.pi)) if self.turn else recording

    def _disturbed(self, recording: Recording, first: int, rng: np.random.Generator) -> NDArray[np.float32]:
        """(6, n, 3) history with errors as the model's own rollouts have them; not of the node held."""
        window = recording.before(first)
        if not self.noise:
            return window
        spread = self.noise / np.sqrt(HISTORY)
        velocity = rng.normal(0, spread, (HISTORY, *window.shape[1:])).cumsum(axis=0)
        velocity[:, recording.node] = 0
        window = window.copy()
        window[1:] += velocity.cumsum(axis=0).astype(np.float32) * np.float32(STEP_S)
        return window


def stretches(
    recordings: Sequence[Recording],
    firsts: Sequence[int] | NDArray[np.int64],
    windows: Sequence[NDArray[np.float32]],
    steps: int,
) -> Batch:
    """A batch from histories (6, n, 3), one per recording. Only errors of velocity are to be put right: a history
    that ends beside the recorded positions has targets that lie beside them as far."""
    sizes = [each.positions.shape[1] for each in recordings]
    graphs = Graphs.of(sizes, [each.edges for each in recordings], [each.rest for each in recordings])
    velocities = np.concatenate([np.diff(window, axis=0)[::-1].swapaxes(0, 1) for window in windows]) / STEP_S
    targets = [
        each.positions[first + 1 : first + steps + 1] + (window[-1] - each.positions[first])
        for each, first, window in zip(recordings, firsts, windows, strict=True)
    ]
    motion = Motion(
        torch.from_numpy(np.concatenate([window[-1] for window in windows])),
        torch.from_numpy(np.ascontiguousarray(velocities)),
    )
    grips = [grip_at(recordings, np.asarray(firsts) + step, graphs) for step in range(steps)]
    return Batch(graphs, motion, grips, torch.from_numpy(np.concatenate(targets, axis=1)))


def grip_at(recordings: Sequence[Recording], records: NDArray[np.int64], graphs: Graphs) -> Grip:
    """What the pickers do after the given record of each recording."""
    pulled = np.flatnonzero(records < PULL_STEPS).tolist()
    nodes = np.array([recordings[k].node + graphs.starts[k] for k in pulled], np.int64)
    steps = np.array([recordings[k].step for k in pulled], np.float32).reshape(-1, 3)
    return Grip(torch.from_numpy(nodes), torch.from_numpy(steps))
