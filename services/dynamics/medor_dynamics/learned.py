"""Backend `learned`: candidates rolled out by a graph network on the coarse mesh (MEDOR, sections IV-B and IV-C)."""

import time
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from medor_cloth.errors import ClothError
from medor_cloth.grasp import grasp
from medor_dynamics.model import Predictor
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.physics import DIVERGED_PENALTY
from medor_dynamics.rewards import rewards
from medor_dynamics.rollout import Pulls, roll_out
from medor_dynamics.shipped import load
from medor_learn.errors import WeightsError
from medor_wire.bus import Call
from medor_wire.content import ByContent
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh, RolloutProgress, RolloutRequest, Rollouts

TRAINING = "python -m medor_dynamics.train --preset {} --data DIR --test DIR --out DIR --hours 4"
LEFT_M = 2.0
"""A rollout with a vertex farther than this from the middle of the table along an axis has diverged [m]."""


class Learned:
    """Rolls candidates out with a model as many chunks at a time as it is given threads."""

    def __init__(self, predictor: Predictor, threads: int, keep: int = 8) -> None:
        self._predictor = predictor
        self._threads = threads
        self._nodes_of = lru_cache(keep)(nodes_of)

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts:
        """Final positions and rewards of all candidates; the fine mesh follows the nodes.

        Raises:
            BadRequest: a mesh without a usable coarse mesh, goals that do not fit it.
            Cancelled, Timeout: the asker does not want the answer any more.
        """
        started = time.perf_counter()
        mesh, total = request.mesh, len(request.picks)
        nodes = self._nodes_of(by_worn_shape(mesh))
        held = np.array([grasp(mesh.vertices, pick) for pick in request.picks], np.int64).reshape(-1)
        positions = np.repeat(mesh.vertices[None], total, axis=0)
        grasping = np.flatnonzero(held >= 0)
        positions[grasping] = self._follow(nodes, request, held, grasping, call)
        diverged = ~(np.abs(positions) < LEFT_M).reshape(total, -1).all(axis=1)
        positions[diverged] = mesh.vertices
        scores = rewards(positions, mesh, request.reward, threads=self._threads)
        return Rollouts(
            positions=positions,
            rewards=scores - DIVERGED_PENALTY * diverged,
            seconds=time.perf_counter() - started,
        )

    def _follow(
        self, nodes: NodeMesh, request: RolloutRequest, held: NDArray[np.int64], grasping: NDArray[np.int64], call: Call
    ) -> NDArray[np.float32]:
        """Vertices after the candidates that grasp something."""
        start = request.mesh.vertices[nodes.ids]
        pulls = Pulls(
            np.array([nodes.node_of(vertex) for vertex in held[grasping]], np.int64),
            (request.places - request.picks)[grasping],
        )
        total = len(request.picks)
        after = roll_out(
            self._predictor,
            nodes.graphs(start, self._predictor.preset),
            start,
            pulls,
            threads=self._threads,
            check=call.check,
            on_done=lambda done: call.progress(RolloutProgress(done=done + total - len(pulls), total=total)),
        )
        with np.errstate(invalid="ignore", over="ignore"):  # diverged rollouts are told by where they end
            return nodes.follow(request.mesh.vertices, after)


class Untrained:
    """Stands where a model would be: says how to get one."""

    def __init__(self, fault: str, preset: str) -> None:
        self._fault = fault
        self._preset = preset

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts:
        """Raises `BadRequest` always: asking again would not help."""
        training = TRAINING.format(self._preset)
        raise BadRequest(f"backend {request.backend!r} has no weights ({self._fault}); train them with `{training}`")


def learned(folder: Path, threads: int, precision: torch.dtype, *, preset: str = "cpu") -> Learned | Untrained:
    """The backend of the weights in a folder, on a GPU when there is one; `preset` names what training makes them."""
    device = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        return Learned(load(folder, device).predictor(precision), threads)
    except WeightsError as error:
        return Untrained(str(error), preset)


def by_worn_shape(mesh: ClothMesh) -> ByContent[ClothMesh]:
    """A mesh compared by what its coarse mesh depends on."""
    return ByContent.of(mesh, mesh.faces, mesh.vertices if mesh.canonical is None else mesh.canonical)


def nodes_of(mesh: ByContent[ClothMesh]) -> NodeMesh:
    try:
        return NodeMesh.of(mesh.value)
    except (ClothError, ValueError) as error:
        raise BadRequest(f"the mesh has no coarse mesh: {error}") from error
