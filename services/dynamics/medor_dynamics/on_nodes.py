"""What all backends share that move the nodes of the coarse mesh: the fine mesh follows (MEDOR, section IV-B)."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from medor_cloth.errors import ClothError
from medor_cloth.grasp import grasp
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.rewards import rated
from medor_dynamics.rollout import Pulls
from medor_wire.bus import Call
from medor_wire.content import ByContent
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh, RolloutProgress, RolloutRequest, Rollouts

LEFT_M = 2.0
"""A rollout with a vertex farther than this from the middle of the table along an axis has diverged [m]."""


class OnNodes(ABC):
    """Rolls candidates out on the nodes of a mesh; who inherits says how nodes move."""

    def __init__(self, threads: int, keep: int) -> None:
        self._threads = threads
        self._nodes_of = lru_cache(keep)(nodes_of)

    @abstractmethod
    def _move(
        self, nodes: NodeMesh, start: NDArray[np.float32], pulls: Pulls, call: Call, on_done: Callable[[int], None]
    ) -> NDArray[np.float32]:
        """Nodes (K, n, 3) after each pull and the fall that follows it, from where they rest at start (n, 3) [m]."""

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
        diverged = np.any(~(np.abs(positions.reshape(total, -1)) < LEFT_M), axis=1)
        return rated(request, positions, diverged, threads=self._threads, started=started)

    def _follow(
        self, nodes: NodeMesh, request: RolloutRequest, held: NDArray[np.int64], grasping: NDArray[np.int64], call: Call
    ) -> NDArray[np.float32]:
        """Vertices after the candidates that grasp something."""
        pulls = Pulls(
            np.array([nodes.node_of(vertex) for vertex in held[grasping]], np.int64),
            (request.places - request.picks)[grasping],
        )
        total = len(request.picks)

        def tell(done: int) -> None:
            call.progress(RolloutProgress(done=done + total - len(pulls), total=total))

        after = self._move(nodes, request.mesh.vertices[nodes.ids], pulls, call, tell)
        with np.errstate(invalid="ignore", over="ignore"):  # diverged rollouts are told by where they end
            return nodes.follow(request.mesh.vertices, after)


def by_worn_shape(mesh: ClothMesh) -> ByContent[ClothMesh]:
    """A mesh compared by what its coarse mesh depends on."""
    return ByContent.of(mesh, mesh.faces, mesh.vertices if mesh.canonical is None else mesh.canonical)


def nodes_of(mesh: ByContent[ClothMesh]) -> NodeMesh:
    try:
        return NodeMesh.of(mesh.value)
    except (ClothError, ValueError) as error:
        raise BadRequest(f"the mesh has no coarse mesh: {error}") from error
