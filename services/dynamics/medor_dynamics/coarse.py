"""Backend `coarse`: candidates rolled out by the cloth solver on the coarse mesh, roughly and fast.

A quarter of the vertices, a quarter of the substeps and no contact between layers: a fair judge of which pulls are
worth a closer look (docs/decisions/0005-screening-by-a-coarse-cloth.md).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from medor_cloth.cloth import Cloth
from medor_cloth.errors import ClothError
from medor_cloth.picker import GLANCE_FRAMES
from medor_cloth.rollout import Cancelled as Stopped
from medor_cloth.rollout import rollouts
from medor_cloth.solver import Solver, SolverConfig
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.on_nodes import OnNodes
from medor_dynamics.physics import without_layers
from medor_dynamics.rollout import Pulls
from medor_wire.bus import Call
from medor_wire.errors import BadRequest

SUBSTEPS = 3
SPRING_PASSES = 2
LEAST_AREA_M2 = 1e-6
"""Of a coarse face: about a five-hundredth of what is usual [m²]."""


class Coarse(OnNodes):
    """Rolls candidates out on the nodes with as many threads as it is given."""

    def __init__(self, threads: int, keep: int = 8, config: SolverConfig | None = None) -> None:
        super().__init__(threads, keep)
        self._solver_of = lru_cache(keep)(partial(solver_of, config=rough(config or SolverConfig())))

    def _move(
        self, nodes: NodeMesh, start: NDArray[np.float32], pulls: Pulls, call: Call, on_done: Callable[[int], None]
    ) -> NDArray[np.float32]:
        solver, picks = self._solver_of(nodes), start[pulls.nodes]
        try:
            return rollouts(
                solver,
                start,
                picks,
                picks + pulls.displacements,
                settle_frames=GLANCE_FRAMES,
                threads=self._threads,
                cancelled=call.cancelled,
                on_done=on_done,
            )
        except Stopped:
            call.check()
            raise


def rough(config: SolverConfig) -> SolverConfig:
    """The same cloth in fewer, larger steps, its layers passing through each other."""
    return replace(without_layers(config), substeps=SUBSTEPS, spring_passes=SPRING_PASSES)


def solver_of(nodes: NodeMesh, config: SolverConfig) -> Solver:
    """The solver of a coarse mesh, at rest as it is worn; faces that clustering left without area are no cloth."""
    worn = nodes.rest_shape[nodes.ids]
    first, second, third = worn[nodes.faces].swapaxes(0, 1).astype(np.float64)
    areas = np.linalg.norm(np.cross(second - first, third - first), axis=1) / 2
    try:
        return Solver(Cloth.from_mesh(worn, nodes.faces[areas > LEAST_AREA_M2]), config)
    except ClothError as error:
        raise BadRequest(f"the coarse mesh cannot be cloth: {error}") from error
