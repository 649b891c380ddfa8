"""One garment made ready for collecting: its cloth, its solver, its flat state, its labels."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from medor_cloth.cluster import Clustered, cluster
from medor_cloth.dataset import GarmentRecord
from medor_cloth.garment import Garment
from medor_cloth.goals import solver_of
from medor_cloth.nocs import NOCS
from medor_cloth.solver import ClothState, Solver
from medor_cloth.start import flattened


@dataclass(frozen=True)
class Scene:
    """A garment on the table.

    Attributes:
        garment: Its worn shape.
        solver: Moves it.
        flat: Flattened under the camera.
        nocs: (V, 3) float32 coordinates of its vertices in the category's cube.
        nodes: Its coarse mesh.
    """

    garment: Garment
    solver: Solver
    flat: ClothState
    nocs: NDArray[np.float32]
    nodes: Clustered

    @classmethod
    def of(cls, garment: Garment) -> Self:
        """A garment not seen before: it is pressed flat."""
        solver = solver_of(garment)
        return cls._with(garment, solver, flattened(garment, solver))

    @classmethod
    def stored(cls, record: GarmentRecord) -> Self:
        """The garment of a shard, bit for bit as it was."""
        solver = solver_of(record.garment)
        return cls._with(record.garment, solver, solver.rest(record["flat"]))

    @classmethod
    def _with(cls, garment: Garment, solver: Solver, flat: ClothState) -> Self:
        nodes = cluster(garment.vertices, garment.faces)
        return cls(garment, solver, flat, NOCS[garment.category].encode(garment.vertices), nodes)
