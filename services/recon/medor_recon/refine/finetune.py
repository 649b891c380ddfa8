"""Finetuning of one reconstruction: its vertices, not the networks, are optimised."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera
from medor_cloth.nocs import NOCS
from medor_cloth.raster import rasterize, visible_vertices
from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.refine import terms
from medor_recon.refine.adam import Adam
from medor_recon.refine.binding import bind
from medor_recon.refine.config import PAPER, Phase, RefineConfig
from medor_recon.refine.isometric import lay_out
from medor_wire.errors import ReconstructionFailed


@dataclass(frozen=True, eq=False)
class Refined:
    """A finetuned mesh; faces and canonical coordinates stay those of the completed one.

    Attributes:
        positions: (V, 3) float32 world frame [m].
        visible: (V,) bool, with no cloth in front of them.
        residual_m: mean distance of the observed points to the nearest visible vertex.
        losses: of every iteration before its step, unweighted (N,) [m²], by the name of the term.
    """

    positions: NDArray[np.float32]
    visible: NDArray[np.bool_]
    residual_m: float
    losses: dict[str, NDArray[np.float64]]


def refine(completed: Completed, canonicalized: Canonicalized, config: RefineConfig | None = PAPER) -> Refined:
    """Moves the vertices onto the observed points.

    Vertices without a term, hidden ones above all, stay where they are.

    Args:
        completed: the mesh.
        canonicalized: the observed points, their canonical coordinates and the camera.
        config: None: no finetuning, visibility and residual only.

    Raises:
        ReconstructionFailed: a mesh that is not finite or of which the camera sees nothing.
    """
    if not np.isfinite(completed.positions).all():
        raise ReconstructionFailed("the completed mesh has coordinates that are not finite")
    problem = _Problem(completed, canonicalized, config or PAPER)
    positions = problem.laid_out(completed) if config else completed.positions.astype(np.float64)
    losses: dict[str, list[float]] = {}
    for phase in config.phases if config else ():
        positions = problem.descend(positions, phase, losses)
    seen = visible(positions, completed.faces, canonicalized.camera)
    _, square = terms.nearest(problem.points, positions, seen)
    return Refined(
        positions.astype(np.float32),
        visible_vertices(positions, completed.faces, canonicalized.camera),
        float(np.sqrt(square).mean()),
        {name: np.array(values) for name, values in losses.items()},
    )


def visible(positions: NDArray, faces: NDArray[np.int32], camera: Camera) -> NDArray[np.int64]:
    """(n,) ascending ids of the corners of all faces that own a pixel.

    Raises:
        ReconstructionFailed: there is none.
    """
    raster = rasterize(positions, faces, camera)
    seen = np.unique(faces[raster.face[raster.mask]]).astype(np.int64)
    if not len(seen):
        raise ReconstructionFailed("the camera sees nothing of the reconstructed mesh")
    return seen


class _Problem:
    """The loss of one view, as a function of the vertices."""

    def __init__(self, completed: Completed, canonicalized: Canonicalized, config: RefineConfig) -> None:
        box = NOCS[canonicalized.category]
        self.config = config
        self.camera, self.faces = canonicalized.camera, completed.faces
        self.points = canonicalized.points.astype(np.float64)
        self.binding = bind(box.encode(completed.canonical), canonicalized.nocs, self.points, config.reach)
        self.edges = _edges(completed.faces)
        first, second = completed.canonical[self.edges].astype(np.float64).swapaxes(0, 1)
        self.rest_lengths = np.linalg.norm(second - first, axis=1)

    def laid_out(self, completed: Completed) -> NDArray[np.float64]:
        """Where finetuning begins (V, 3)."""
        positions = completed.positions.astype(np.float64)
        if self.config.isometry is None:
            return positions
        return lay_out(positions, completed.canonical, self.edges, self.binding, self.config.isometry)

    def descend(self, positions: NDArray, phase: Phase, losses: dict[str, list[float]]) -> NDArray[np.float64]:
        """Where the vertices (V, 3) are after a phase; every iteration's values are appended to `losses`."""
        adam = Adam(positions.shape, self.config.learning_rate)
        for iteration in range(phase.iterations):
            if iteration % self.config.look_every == 0:
                seen = visible(positions, self.faces, self.camera)
            gradient = np.zeros_like(positions)
            for name, (value, slope) in self.terms(positions, phase, seen).items():
                losses.setdefault(name, []).append(value)
                gradient += getattr(phase, name) * slope
            positions = positions + adam.step(gradient)
        return positions

    def terms(self, positions: NDArray, phase: Phase, seen: NDArray[np.int64]) -> dict[str, terms.Term]:
        """All terms, named as their weights are; the edges' only when it counts."""
        found = {
            "chamfer": terms.chamfer(self.points, positions, seen),
            "consistency": terms.consistency(positions, *self.binding),
            "table": terms.table(positions),
        }
        if phase.stretch:
            found["stretch"] = terms.stretch(positions, self.edges, self.rest_lengths)
        return found


def _edges(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """(E, 2) unique undirected."""
    return np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
