"""Rollouts of a plan's candidates by a model: one mesh, many pulls, in batches that fit the cache."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import ceil

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from medor_dynamics.frame import headings, turned
from medor_dynamics.graphs import Graphs
from medor_dynamics.model import Grip, Motion, Predictor
from medor_dynamics.preset import PULL_STEPS, STEPS

CHUNK = 10
"""Candidates in one batch on a CPU: fewer pay for the calls between layers, more for values that leave the cache."""


@dataclass(frozen=True, eq=False)
class Pulls:
    """K pulls on one mesh: nodes (K,) held and displacements (K, 3) from pick to place [m]."""

    nodes: NDArray[np.int64]
    displacements: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.nodes)

    def __getitem__(self, part: slice) -> "Pulls":
        return Pulls(self.nodes[part], self.displacements[part])


def roll_out(
    predictor: Predictor,
    graph: Graphs,
    positions: NDArray[np.float32],
    pulls: Pulls,
    *,
    chunk: int = CHUNK,
    threads: int = 1,
    check: Callable[[], None] = lambda: None,
    on_done: Callable[[int], None] = lambda done: None,
) -> NDArray[np.float32]:
    """Nodes after each pull and the fall that follows it (K, n, 3) [m].

    Args:
        predictor: the model, made ready for its device.
        graph: of the mesh.
        positions: (n, 3) nodes before the action, at rest [m].
        pulls: the candidates.
        chunk: how many go in one batch at most; fewer where threads would stand idle. Rounding apart, the result
            depends neither on it nor on the threads.
        threads: chunks at work at a time.
        check: asked before each chunk; whatever it raises ends the rollouts.
        on_done: told the number of pulls done after each chunk.
    """
    chunk = min(chunk, max(ceil(len(pulls) / threads), 1))
    parts = [slice(start, min(start + chunk, len(pulls))) for start in range(0, len(pulls), chunk)]
    batches = {size: graph.repeated(size) for size in {part.stop - part.start for part in parts}}
    after = np.empty((len(pulls), *positions.shape), np.float32)
    done = 0

    def roll(part: slice) -> int:
        check()
        after[part] = roll_chunk(predictor, batches[part.stop - part.start], positions, pulls[part])
        return part.stop - part.start

    with ThreadPoolExecutor(threads, initializer=partial(torch.set_num_threads, 1)) as pool:
        try:
            for size in pool.map(roll, parts):
                done += size
                on_done(done)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return after


@torch.inference_mode()
def roll_chunk(
    predictor: Predictor, graphs: Graphs, positions: NDArray[np.float32], pulls: Pulls
) -> NDArray[np.float32]:
    """Nodes after each of a few pulls (K, n, 3) [m]; `graphs` is the mesh's graph once for each."""
    angles = headings(pulls.displacements, predictor.preset)
    device = predictor.normalizer.node_scale.device
    motion = Motion.resting(torch.from_numpy(turned(positions, -angles)).reshape(-1, 3).to(device))
    nodes = torch.from_numpy(pulls.nodes + graphs.starts[:-1]).to(device)
    steps = torch.from_numpy(turned(pulls.displacements[:, None] / PULL_STEPS, -angles)[:, 0]).to(device)
    for grip in grips(nodes, steps):
        motion = predictor(graphs, motion, grip)
    with np.errstate(invalid="ignore", over="ignore"):  # a rollout that left the finite numbers is told by its result
        return turned(motion.positions.reshape(len(pulls), *positions.shape).cpu().numpy(), angles)


def grips(nodes: Tensor, displacements: Tensor) -> list[Grip]:
    """What pickers do in each step of a rollout: they pull, then they are open."""
    nothing = Grip(nodes[:0], displacements[:0])
    return [Grip(nodes, displacements)] * PULL_STEPS + [nothing] * (STEPS - PULL_STEPS)
