"""What a glance sees of each pull: maps around the pick, turned so that the pull goes to the right.

Near ones for the heights where the pull begins, passes and ends, and wide ones for the whole garment and for what the
completed mesh believes of it. A pull looks the same wherever the garment lies and whichever way it is turned.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial import KDTree

from medor_planner.judge.features import ways, worn
from medor_planner.judge.relief import CELL_M, Relief
from medor_planner.judge.situation import Situation
from medor_planner.sampling import Candidates

NEAR = ("height", "cloth")
"""What is seen: height over `HEIGHT_M`, whether there is cloth."""
WIDE = ("height", "cloth", "layers", "worn height", "worn side", "goal along", "goal aside")
"""Besides, what is believed: layers, place in the garment, way to the goal over `WAY_M`."""
NEAR_CELLS, NEAR_CELL_M, NEAR_AHEAD_M = 64, 0.005, 0.05
"""Cells along each side of the near maps, their side [m], and how far before the pick their middle is [m]."""
WIDE_CELLS, WIDE_CELL_M = 48, 0.015
"""Of the wide ones, whose middle is the pick."""
HEIGHT_M, WAY_M = 0.02, 0.1
MOST = 8.0
"""Values beyond it count as so far."""
COARSE = 3
"""Cells of the relief along the side of one that is looked up in the mesh."""
BLUR_M = 0.01
"""Of the layers [m]."""


@dataclass(frozen=True, eq=False)
class Patches:
    """Maps of K pulls, float16.

    Attributes:
        near: (K, 2, 64, 64), rows across the pull, columns along it.
        wide: (K, 7, 48, 48).
    """

    near: NDArray[np.float16]
    wide: NDArray[np.float16]

    def __len__(self) -> int:
        return len(self.near)

    @property
    def mirrored(self) -> "Patches":
        """The same pulls in a mirror along them: what lay to the left lies to the right."""
        wide = self.wide[:, :, ::-1].copy()
        wide[:, WIDE.index("goal aside")] *= -1
        return Patches(self.near[:, :, ::-1].copy(), wide)


@dataclass(frozen=True, eq=False)
class Maps:
    """A garment from above.

    Attributes:
        relief: whose cells the maps have.
        seen: (R, C, 2) as `NEAR`, float32.
        all: (R, C, 7) as `WIDE`, but the way to the goal along x and y of the world; no belief where there is no cloth.
    """

    relief: Relief
    seen: NDArray[np.float32]
    all: NDArray[np.float32]

    @classmethod
    def of(cls, situation: Situation) -> Self:
        """What is seen and believed of a garment.

        Raises:
            NoGarment: no pixel of the view shows cloth.
        """
        relief = Relief.of(situation.view, situation.camera)
        seen = np.stack([relief.heights / HEIGHT_M, relief.heights > 0], axis=-1).astype(np.float32)
        believed = _layers(situation, relief)[..., None], _of_the_top(situation, relief)
        every = np.concatenate([seen, *believed], axis=-1)
        return cls(relief, *(np.clip(it, -MOST, MOST) for it in (seen, every)))

    def around(self, candidates: Candidates) -> Patches:
        """The maps around pulls."""
        picks, pulls = candidates.picks[:, :2], (candidates.places - candidates.picks)[:, :2]
        along = pulls / np.maximum(np.linalg.norm(pulls, axis=1, keepdims=True), 1e-6)
        aside = np.stack([-along[:, 1], along[:, 0]], axis=1)
        near = self.relief.at(self.seen, _grid(picks, along, aside, NEAR_CELLS, NEAR_CELL_M, NEAR_AHEAD_M))
        wide = self.relief.at(self.all, _grid(picks, along, aside, WIDE_CELLS, WIDE_CELL_M, 0.0))
        axes = np.stack([along, aside], axis=2)[:, None]
        wide[..., -2:] = (wide[..., -2:].reshape(len(picks), -1, 1, 2) @ axes).reshape(*wide.shape[:-1], 2)
        return Patches(*(np.moveaxis(it, -1, 1).astype(np.float16) for it in (near, wide)))


def _grid(picks: NDArray, along: NDArray, aside: NDArray, cells: int, cell_m: float, ahead_m: float) -> NDArray:
    """(K, cells, cells, 2) points around picks (K, 2): rows aside of, columns along the pulls [m]."""
    steps = (np.arange(cells, dtype=np.float32) - (cells - 1) / 2) * np.float32(cell_m)
    columns, rows = (steps + np.float32(ahead_m))[None, None, :, None], steps[None, :, None, None]
    return picks[:, None, None] + columns * along[:, None, None] + rows * aside[:, None, None]


def _layers(situation: Situation, relief: Relief) -> NDArray[np.float32]:
    """(R, C) how many layers of the mesh lie over each other."""
    vertices = situation.mesh.vertices
    of_one_m2 = situation.goals.flat_coverage_m2 / len(vertices)
    cells = ((vertices[:, :2] - relief.corner) // CELL_M).astype(np.int64)[:, ::-1]
    rows, columns = cells[((cells >= 0) & (cells < relief.heights.shape)).all(axis=1)].T
    found = np.zeros(relief.heights.shape, np.float32)
    np.add.at(found, (rows, columns), of_one_m2 / CELL_M**2)
    return np.asarray(gaussian_filter(found, BLUR_M / CELL_M), np.float32)


def _of_the_top(situation: Situation, relief: Relief) -> NDArray[np.float32]:
    """(R, C, 4) of the nearest visible vertex: height and side in the garment, way to the goal."""
    mesh = situation.mesh
    top = mesh.visible if mesh.visible.any() else np.ones_like(mesh.visible)
    place, way = worn(mesh)[top], ways(mesh, situation.goals)[top]
    told = np.c_[place[:, 2], np.abs(place[:, 0]), way[:, :2] / WAY_M]
    cloth = relief.heights[::COARSE, ::COARSE] > 0
    corners = relief.corner + (np.argwhere(cloth)[:, ::-1] * COARSE + 0.5) * CELL_M
    found = np.zeros((*cloth.shape, 4), np.float32)
    found[cloth] = told.astype(np.float32)[KDTree(mesh.vertices[top, :2]).query(corners)[1]]
    rows, columns = relief.heights.shape
    return np.asarray(
        found.repeat(COARSE, axis=0).repeat(COARSE, axis=1)[:rows, :columns] * (relief.heights > 0)[..., None]
    )
