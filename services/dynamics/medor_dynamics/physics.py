"""Backends `physics` and `layerless`: candidates rolled out by the cloth solver (MEDOR's ground-truth dynamics).

A completed mesh has layers that run through each other, faces crossing faces by the hundred. Contact takes them for a
tangle: it crumples them, and costs ten times as much as on a clean mesh. `layerless` leaves contact between layers out.
"""

import time
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from medor_cloth.cloth import Cloth
from medor_cloth.errors import ClothError
from medor_cloth.picker import SETTLE_FRAMES
from medor_cloth.rollout import Cancelled as Stopped
from medor_cloth.rollout import rollouts
from medor_cloth.solver import Solver, SolverConfig
from medor_dynamics.rewards import rated
from medor_wire.bus import Call
from medor_wire.content import ByContent
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh, RolloutProgress, RolloutRequest, Rollouts


def without_layers(config: SolverConfig) -> SolverConfig:
    """The same cloth, its layers passing through each other; nothing thin is left that would need small steps."""
    return replace(config, layers=False, substeps=config.substeps // 2)


class Physics:
    """Rolls candidates out on a mesh with as many threads as it is given.

    Args:
        threads: how many to use.
        keep: solvers kept, of the meshes asked for last.
        config: constants of the cloth.
        settle_frames: longest time the cloth gets to settle. With the default a mesh that is true ends where the
            simulated cell's cloth will, to the bit.
    """

    def __init__(
        self, threads: int, keep: int = 8, config: SolverConfig | None = None, settle_frames: int = SETTLE_FRAMES
    ) -> None:
        self._threads, self._settle_frames = threads, settle_frames
        self._solver_of = lru_cache(keep)(partial(solver_of, config=config))

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts:
        """Final positions and rewards of all candidates. Neither depends on the number of threads.

        Raises:
            BadRequest: a mesh that cannot be cloth, goals that do not fit it.
            Cancelled, Timeout: the asker does not want the answer any more.
        """
        started = time.perf_counter()
        mesh, total = request.mesh, len(request.picks)
        solver = self._solver_of(by_rest_shape(mesh))
        try:
            positions = rollouts(
                solver,
                mesh.vertices,
                request.picks,
                request.places,
                settle_frames=self._settle_frames,
                threads=self._threads,
                cancelled=call.cancelled,
                on_done=lambda done: call.progress(RolloutProgress(done=done, total=total)),
            )
        except Stopped:
            call.check()
            raise
        diverged = np.any(~np.isfinite(positions.reshape(total, -1)), axis=1)
        return rated(request, positions, diverged, threads=self._threads, started=started)


def by_rest_shape(mesh: ClothMesh) -> ByContent[ClothMesh]:
    """A mesh compared by what its solver depends on: where its rest shape is known, not by how it lies."""
    return ByContent.of(mesh, mesh.faces, mesh.panel_uv if mesh.panel_uv is not None else rest_shape(mesh))


def solver_of(mesh: ByContent[ClothMesh], config: SolverConfig | None = None) -> Solver:
    """The solver of a mesh, at rest in its panels or else in its rest shape."""
    try:
        return Solver(Cloth.from_mesh(rest_shape(mesh.value), mesh.value.faces, mesh.value.panel_uv), config)
    except ClothError as error:
        raise BadRequest(f"the mesh cannot be cloth: {error}") from error


def rest_shape(mesh: ClothMesh) -> NDArray[np.float32]:
    """(V, 3) where a mesh without panels is at rest: in canonical space, else as it lies (MEDOR, section IV-B).

    A reconstructed mesh lies stretched in places. As it lies it would keep that for ever.
    """
    return mesh.vertices if mesh.canonical is None else mesh.canonical
