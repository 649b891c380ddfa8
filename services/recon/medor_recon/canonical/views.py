"""The views of a data set in memory: of every image only the box around the cloth, as whole numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from medor_cloth.dataset import STORED, Dataset, GarmentRecord, box_of
from medor_cloth.errors import DatasetError

MIN_PIXELS = 1000
"""Views with less cloth are not learnt from (MEDOR, section 5.1 and the released code)."""
SIDE_PX = 200
"""Of the images."""


@dataclass(frozen=True, eq=False)
class Views:
    """V views, their boxes one after the other.

    Attributes:
        categories: that may occur.
        depth: (S,) uint16 of all boxes, row by row, in steps of `STORED["depth"]`; 0 off the cloth.
        nocs: (S, 3) uint16 labels, in steps of `STORED["nocs"]`.
        start: (V,) int64 where each box begins.
        box: (V, 4) int32 first row, first column, height and width of each.
        centre: (V, 2) float32 (u, v) [px] of the cloth pixel nearest to the middle of the box.
        category: (V,) int64 number within `categories`.
        step: (V,) int32 number of the observation within its trajectory.
    """

    categories: tuple[str, ...]
    depth: NDArray[np.uint16]
    nocs: NDArray[np.uint16]
    start: NDArray[np.int64]
    box: NDArray[np.int32]
    centre: NDArray[np.float32]
    category: NDArray[np.int64]
    step: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.start)

    def of(self, category: str) -> NDArray[np.int64]:
        """Rows of the views of one category."""
        return np.flatnonzero(self.category == self.categories.index(category))

    @classmethod
    def read(cls, folders: Sequence[Path], categories: Sequence[str], split: str) -> "Views":
        """All views of some categories.

        Args:
            folders: data sets; what they hold of other categories is left out.
            categories: wanted.
            split: `train` or `test`.

        Raises:
            DatasetError: data of another kind, split or NOCS box, or no view of one of the categories.
        """
        crops = [crop for folder in folders for crop in _crops(folder, categories, split)]
        found = {crop.category for crop in crops}
        if missing := sorted(set(categories) - found):
            raise DatasetError(f"expected views of {', '.join(categories)}, found none of {', '.join(missing)}")
        return cls._joined(tuple(categories), crops)

    @classmethod
    def _joined(cls, categories: tuple[str, ...], crops: "list[_Crop]") -> "Views":
        sizes = np.array([crop.depth.size for crop in crops])
        return cls(
            categories,
            np.concatenate([crop.depth.ravel() for crop in crops]),
            np.concatenate([crop.nocs.reshape(-1, 3) for crop in crops]),
            np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
            np.array([crop.box for crop in crops], np.int32),
            np.array([crop.centre for crop in crops], np.float32),
            np.array([categories.index(crop.category) for crop in crops]),
            np.array([crop.step for crop in crops], np.int32),
        )


@dataclass(frozen=True, eq=False)
class _Crop:
    category: str
    step: int
    box: tuple[int, int, int, int]
    centre: tuple[float, float]
    depth: NDArray[np.uint16]
    nocs: NDArray[np.uint16]


def _crops(folder: Path, categories: Sequence[str], split: str) -> Iterator[_Crop]:
    data = Dataset(folder)
    if (data.kind, data.split) != ("recon", split):
        raise DatasetError(f"{folder}: expected recon data of split {split!r}, got {data.kind} of {data.split!r}")
    for record in data.garments:
        if record.category not in categories:
            continue
        _check_box(folder, record)
        for trajectory in record.trajectories():
            images = zip(*(trajectory[name] for name in ("depth", "mask", "nocs")), strict=True)
            for step, (depth, mask, nocs) in enumerate(images):
                if mask.sum() >= MIN_PIXELS:
                    yield _crop(record.category, step, np.where(mask, depth, 0), nocs)


def _check_box(folder: Path, record: GarmentRecord) -> None:
    stored, ours = record.plan["nocs_box"], box_of(record.category)
    if not np.allclose(stored, ours):
        raise DatasetError(f"{folder}: expected {record.category} in the NOCS box {ours}, got {stored}")


def _crop(category: str, step: int, depth: NDArray[np.float32], nocs: NDArray[np.float32]) -> _Crop:
    rows, columns = np.nonzero(depth)
    top, left, bottom, right = rows.min(), columns.min(), rows.max() + 1, columns.max() + 1
    middle = (rows - (top + bottom - 1) / 2) ** 2 + (columns - (left + right - 1) / 2) ** 2
    nearest = int(middle.argmin())
    return _Crop(
        category,
        step,
        (int(top), int(left), int(bottom - top), int(right - left)),
        (float(columns[nearest]) + 0.5, float(rows[nearest]) + 0.5),
        STORED["depth"].store(depth[top:bottom, left:right]),
        STORED["nocs"].store(nocs[top:bottom, left:right]),
    )
