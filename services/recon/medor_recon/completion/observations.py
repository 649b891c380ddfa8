"""What completion learns from: views whose canonical coordinates are known, and the garments in them."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import overhead
from medor_cloth.dataset import Dataset, GarmentRecord, Trajectory
from medor_recon.canonicalized import Canonicalized
from medor_recon.completion.pixels import Pixels, thinned
from medor_recon.completion.turn import NONE, Turn

CAMERA = overhead(200)
"""Of the views of a data set."""
MIN_PIXELS = 1000
"""Views with fewer cloth pixels at 200 px are left out (MEDOR, section 5.1)."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A garment of the data set, in the NOCS cube.

    Attributes:
        record: where it is stored.
        nocs: (V, 3) float32 vertices.
        faces: (F, 3) int32.
        winding: (64, 64, 64) float32, read when first asked for.
    """

    record: GarmentRecord
    nocs: NDArray[np.float32]
    faces: NDArray[np.int32]
    _winding: list[NDArray[np.float16]] = field(default_factory=list)

    @property
    def winding(self) -> NDArray[np.float16]:
        """(64, 64, 64) winding numbers at the nodes of the cube, to 0.001."""
        if not self._winding:
            self._winding.append(self.record.winding(64).astype(np.float16))
        return self._winding[0]


@dataclass(frozen=True, eq=False)
class Observation:
    """One view of a garment whose state is known.

    Attributes:
        shape: the garment.
        positions: (V, 3) float32 its vertices, world frame [m].
        true: its visible pixels with true canonical coordinates.
        trajectory, step: where it comes from.
    """

    shape: Shape
    positions: NDArray[np.float32]
    true: Pixels
    trajectory: Trajectory
    step: int


@dataclass(frozen=True, eq=False)
class Prediction:
    """A canonicaliser's view of an observation, and how the garment would be turned if it were right."""

    pixels: Pixels
    turn: Turn = NONE


def observations(folder: Path, categories: tuple[str, ...], spacing: float) -> list[Observation]:
    """All views of a data set that show enough, in its order.

    Args:
        spacing: of the pixels kept, on the table [m].
    """
    found = []
    for record in Dataset(folder).garments:
        if record.category in categories:
            shape = Shape(record, record.box.encode(record["vertices"]), record["faces"])
            found += [view for trajectory in record.trajectories() for view in _views(shape, trajectory, spacing)]
    return found


def split(everything: list[Observation], held_out: float) -> tuple[list[Observation], list[Observation]]:
    """Observations to learn from and to validate on; no garment is in both.

    Args:
        held_out: share of the garments to validate on, at least one of each category.
    """
    every = max(2, round(1 / held_out))
    order: dict[str, dict[int, int]] = {}
    for view in everything:
        seeds = order.setdefault(view.shape.record.category, {})
        seeds.setdefault(view.shape.record.seed, len(seeds))
    kept_back = [order[view.shape.record.category][view.shape.record.seed] % every == 0 for view in everything]
    learn = [view for view, back in zip(everything, kept_back, strict=True) if not back]
    return learn, [view for view, back in zip(everything, kept_back, strict=True) if back]


def truth(trajectory: Trajectory, step: int) -> Canonicalized:
    """A view as a faultless canonicaliser would give it."""
    depth, mask, nocs = (trajectory[name][step] for name in ("depth", "mask", "nocs"))
    return _known(trajectory.garment.category, depth, mask, nocs)


def _views(shape: Shape, trajectory: Trajectory, spacing: float) -> Iterator[Observation]:
    """Reads each array once for the five views of a trajectory."""
    arrays = [trajectory[name] for name in ("depth", "mask", "nocs", "positions")]
    for step, (depth, mask, nocs, positions) in enumerate(zip(*arrays, strict=True)):
        if mask.sum() >= MIN_PIXELS:
            seen = _known(shape.record.category, depth, mask, nocs)
            yield Observation(shape, positions, thinned(seen, spacing), trajectory, step)


def _known(category: str, depth: NDArray, mask: NDArray, nocs: NDArray) -> Canonicalized:
    pixels = np.argwhere(mask & (depth > 0)).astype(np.int32)
    rows, columns = pixels.T
    ones = np.ones((len(pixels), 3), np.float32)
    none = np.zeros((len(pixels), 0), np.float32)
    return Canonicalized(
        category, pixels, CAMERA.back_project(depth)[rows, columns], nocs[rows, columns], ones, none, CAMERA
    )
