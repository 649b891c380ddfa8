"""Data sets of cloth on disk: what is in them, and how to read them (extra `medor-cloth[data]`).

A data set is a folder of shards, at any depth; a shard is a zarr group (format 3), its name means nothing. Merging two
data sets is moving their shards into one folder. A shard holds one group a garment, and in it one row a trajectory:

    tshirt/shard-0003-of-0010.zarr      attributes: plan (all the data depend on), shard, revisions
        garment-000012                  attributes: category, seed, first (id of the trajectory in row 0)
            vertices (V, 3)  faces (F, 3)  panel_uv (F, 3, 2)   the garment, canonical space
            edges (E, 2)  rest_lengths (E,)                     its cloth
            flat (V, 3)                                         flattened on the table, world frame
            winding (N, N, N)                                   winding numbers at nodes of the NOCS cube, if asked for
            complete (T,)                                       rows that are written
            recon, five observations a row; one more array axis in front for the row:
                depth (5, H, W)  mask (5, H, W)                 200 px overhead camera
                nocs (5, H, W, 3)                               of the surface seen, 0 off the cloth
                positions (5, V, 3)                             world frame
                moves (5, 2, 3)                                 pick and place before each observation, NaN after a drop
            dynamics, one pick-and-place a row:
                node_ids (n,)  node_edges (e, 2)  node_rest_lengths (e,)    (no row axis) the coarse mesh
                positions (17, V, 3)                            every fifth frame of 0.01 s, the first before the pick
                visible (n,)                                    nodes the camera sees before the pick
                move (2, 3)                                     picker centre where it closes, and 50 frames later
                grasp (2,)                                      node aimed at, vertex held

One chunk a row and array, written whole under another name and then renamed; `complete` last.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from medor_cloth.errors import DatasetError
from medor_cloth.garment import Garment
from medor_cloth.levels import Levels
from medor_cloth.nocs import NOCS, NocsBox
from medor_cloth.nocs import STORED as NOCS_LEVELS
from medor_cloth.winding import winding_grid

FORMAT = 1
"""Rises when a reader of older data would be misled."""
SPLITS = {"train": range(800_000), "test": range(800_000, 900_000)}
"""Seeds of the garments that may be learnt from, and of those kept for tests."""
STORED = {
    "depth": Levels("uint16", 1e-4),
    "positions": Levels("int16", 5e-5),
    "nocs": NOCS_LEVELS,
    "winding": Levels("int16", 1e-4),
}
"""Arrays stored as levels; all others are stored as they are."""
FRAMES_PER_STEP = 5
"""Frames of 0.01 s between two recorded positions of a dynamics trajectory (MEDOR, section 5.2)."""


@dataclass(frozen=True)
class GarmentRecord:
    """One garment of a data set and its trajectories.

    `record["rest_lengths"]` reads an array of the garment in SI units; see the module for the names.
    """

    group: zarr.Group
    plan: dict[str, Any]
    """What the shard was collected with."""

    @property
    def category(self) -> str:
        return str(self.group.attrs["category"])

    @property
    def seed(self) -> int:
        return int(self.group.attrs["seed"])  # type: ignore[arg-type]

    @property
    def box(self) -> NocsBox:
        """The NOCS cube the labels were made with."""
        lower, upper = self.plan["nocs_box"]
        return NocsBox(tuple(lower), tuple(upper))

    @cached_property
    def garment(self) -> Garment:
        """The garment itself; no generator is asked."""
        return Garment(self.category, self.seed, self["vertices"], self["faces"], self["panel_uv"])

    @cached_property
    def complete(self) -> NDArray[np.bool_]:
        """(T,) rows that are written, as of the first look."""
        return np.asarray(_array(self.group, "complete")[:])

    def __getitem__(self, name: str) -> NDArray:
        return _values(name, _array(self.group, name)[...])

    def winding(self, nodes: int = 64) -> NDArray[np.float32]:
        """Winding numbers at nodes³ points of the NOCS cube, stored or computed (0.4 s at 64, 3.3 s at 128)."""
        if "winding" in self.group and _array(self.group, "winding").shape[0] == nodes:
            return self["winding"]
        return winding_grid(self.box.encode(self.garment.vertices), self.garment.faces, nodes)

    def trajectories(self) -> list["Trajectory"]:
        """The complete ones, in order."""
        return [Trajectory(self, int(row)) for row in np.flatnonzero(self.complete)]


@dataclass(frozen=True)
class Trajectory:
    """One trajectory; `trajectory["depth"]` reads one of its arrays, in SI units and from disk each time."""

    garment: GarmentRecord
    row: int

    @property
    def id(self) -> int:
        """Number of the trajectory within its plan."""
        return int(self.garment.group.attrs["first"]) + self.row  # type: ignore[arg-type]

    def __getitem__(self, name: str) -> NDArray:
        return _values(name, _array(self.garment.group, name)[self.row])


class Dataset:
    """All trajectories of a folder of shards that are complete, in the order of shard names.

    Args:
        folder: Of one kind (`recon` or `dynamics`), of any number of categories. A single shard will do.

    Raises:
        DatasetError: no shard, shards of different kinds, garments for training beside garments for tests, one
            trajectory twice, or a format this reader does not know.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)
        self.shards = [_open(path) for path in shard_paths(self.folder)]
        if not self.shards:
            raise DatasetError(f"no shards (*.zarr) under {folder}")
        self.kind = self._common("kind")
        self.split = self._common("split")
        self.garments = [GarmentRecord(group, _plan(shard)) for shard in self.shards for group in _garments(shard)]
        self.trajectories = [trajectory for record in self.garments for trajectory in record.trajectories()]
        self._check()

    def __len__(self) -> int:
        return len(self.trajectories)

    def __getitem__(self, index: int) -> Trajectory:
        return self.trajectories[index]

    def __iter__(self) -> Iterator[Trajectory]:
        return iter(self.trajectories)

    def _common(self, name: str) -> str:
        values = {_plan(shard)[name] for shard in self.shards}
        if len(values) > 1:
            raise DatasetError(f"expected shards of one {name}, got {' and '.join(sorted(values))}")
        return values.pop()

    def _check(self) -> None:
        strangers = [record.seed for record in self.garments if record.seed not in SPLITS[self.split]]
        if strangers:
            raise DatasetError(f"garments {strangers} do not belong to split {self.split!r}")
        names = [(t.garment.category, t.garment.plan["seed"], t.garment.seed, t.id) for t in self]
        if len(set(names)) < len(names):
            raise DatasetError("the same trajectories twice: one shard was copied or collected twice")


def shard_paths(folder: Path) -> list[Path]:
    """The shards in a folder, at any depth, sorted; the folder itself when it is one."""
    if folder.suffix == ".zarr":
        return [folder] if (folder / "zarr.json").is_file() else []
    folders = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    return [shard for path in folders for shard in shard_paths(path)]


def box_of(category: str) -> list[list[float]]:
    """A category's NOCS box as a plan records it."""
    return [list(NOCS[category].lower), list(NOCS[category].upper)]


def _open(path: Path) -> zarr.Group:
    shard = zarr.open_group(path, mode="r")
    if shard.attrs.get("format") != FORMAT:
        raise DatasetError(f"{path}: expected format {FORMAT}, got {shard.attrs.get('format')}")
    return shard


def _plan(shard: zarr.Group) -> dict[str, Any]:
    return dict(shard.attrs["plan"])  # type: ignore[arg-type]


def _garments(shard: zarr.Group) -> list[zarr.Group]:
    return [group for _, group in sorted(shard.groups())]


def _array(group: zarr.Group, name: str) -> zarr.Array:
    array = group[name]
    assert isinstance(array, zarr.Array)
    return array


def _values(name: str, stored: Any) -> NDArray:
    return STORED[name].load(stored) if name in STORED else np.asarray(stored)
