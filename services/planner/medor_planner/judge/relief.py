"""The heights of the cloth over the table, on a grid, so that what is seen can be looked up where a pull passes."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from medor_cloth.camera import Camera
from medor_wire.errors import NoGarment
from medor_wire.messages import DepthView

CELL_M = 0.003
"""Side of a cell [m]."""
MARGIN_M = 0.25
"""Table around the cloth that the grid holds [m]: no pull is longer."""
TABLE_M = 0.002
"""What is lower is table, where no mask says what is cloth [m]."""


@dataclass(frozen=True, eq=False)
class Relief:
    """Heights on square cells.

    Attributes:
        heights: (R, C) highest point seen in each cell [m]; row along y, column along x; 0 without cloth.
        corner: (2,) world x, y of the outer corner of cell (0, 0) [m].
        rim_m: from the cloth to the edge of the picture, at its nearest [m].
    """

    heights: NDArray[np.float32]
    corner: NDArray[np.float64]
    rim_m: float

    @classmethod
    def of(cls, view: DepthView, camera: Camera) -> Self:
        """From a depth image.

        Raises:
            NoGarment: no pixel shows cloth.
        """
        points = camera.back_project(view.depth)
        with np.errstate(invalid="ignore"):
            cloth = np.isfinite(points[..., 2]) & (points[..., 2] > TABLE_M)
        if view.mask is not None:
            cloth = view.mask & np.isfinite(points[..., 2])
        if not cloth.any():
            raise NoGarment("no pixel of the view shows cloth")
        seen = points[cloth].astype(np.float64)
        corner = seen[:, :2].min(axis=0) - MARGIN_M
        columns, rows = ((seen[:, :2] - corner) // CELL_M).astype(np.int64).T
        shape = np.ceil((seen[:, [1, 0]].max(axis=0) + MARGIN_M - corner[::-1]) / CELL_M).astype(np.int64)
        heights = np.zeros(shape, np.float32)
        np.maximum.at(heights, (rows, columns), np.maximum(seen[:, 2], TABLE_M))
        return cls(heights, corner, _rim(cloth, camera, float(view.depth[cloth].mean())))

    @cached_property
    def area_m2(self) -> float:
        """Of the table that cloth hides [m²]."""
        return float(np.count_nonzero(self.heights)) * CELL_M**2

    @cached_property
    def inside(self) -> NDArray[np.float64]:
        """(R, C) of cells with cloth: distance to the outline [m]; elsewhere 0."""
        return np.asarray(distance_transform_edt(self.heights > 0, sampling=CELL_M))

    @cached_property
    def outside(self) -> NDArray[np.float64]:
        """(R, C) of cells without cloth: distance to it [m]; elsewhere 0."""
        return np.asarray(distance_transform_edt(self.heights == 0, sampling=CELL_M))

    def at(self, values: NDArray, xy: NDArray) -> NDArray:
        """(..., *C) values (R, C, *C) of the cells at points (..., 2) [m]; beyond the grid those of its edge."""
        cells = ((np.asarray(xy) - self.corner) * (1 / CELL_M)).astype(np.int32)
        rows, columns = values.shape[:2]
        at = np.clip(cells[..., 1], 0, rows - 1) * columns + np.clip(cells[..., 0], 0, columns - 1)
        return values.reshape(rows * columns, *values.shape[2:]).take(at, axis=0)


def _rim(cloth: NDArray[np.bool_], camera: Camera, depth: float) -> float:
    """Distance of the pixels on cloth to the edge of the picture [m]."""
    rows, columns = np.flatnonzero(cloth.any(axis=1)), np.flatnonzero(cloth.any(axis=0))
    gaps = rows[0], columns[0], cloth.shape[0] - 1 - rows[-1], cloth.shape[1] - 1 - columns[-1]
    return float(min(gaps)) * depth / camera.K[0, 0]
