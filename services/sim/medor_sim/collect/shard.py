"""One shard of a data set on disk: written garment by garment, row by row, never half."""

import contextlib
import errno
import fcntl
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import BloscCodec

from medor_cloth.dataset import FORMAT, STORED, GarmentRecord
from medor_cloth.errors import DatasetError
from medor_cloth.winding import winding_grid
from medor_sim.collect.plan import Plan
from medor_sim.collect.scene import Scene

LAYOUT = {
    "compressors": BloscCodec(cname="zstd", clevel=5, shuffle="bitshuffle"),
    "chunk_key_encoding": {"name": "default", "separator": "."},  # one file a chunk, no folders
}


@dataclass(frozen=True)
class Shard:
    """One of `count` shards of a plan.

    Attributes:
        folder: Of the whole data set.
    """

    plan: Plan
    index: int
    count: int
    folder: Path

    @property
    def path(self) -> Path:
        """Where the shard lies: `<folder>/<kind>/<category>/shard-0003-of-0010.zarr`."""
        name = f"shard-{self.index:04d}-of-{self.count:04d}.zarr"
        return self.folder / self.plan.kind / self.plan.category / name

    @contextlib.contextmanager
    def opened(self) -> Iterator[None]:
        """Makes the shard, or finds it again, and keeps other processes out of it.

        Raises:
            DatasetError: another plan's shard lies there, or another process is writing it.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.with_suffix(".lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise DatasetError(f"another process is collecting {self.path}") from None
            with _full_disk_told():
                self._begin()
            yield
            shutil.rmtree(self._unfinished, ignore_errors=True)

    def _begin(self) -> None:
        if not (self.path / "zarr.json").exists():
            attributes = {
                "format": FORMAT,
                "plan": self.plan.record(),
                "shard": [self.index, self.count],
                "revisions": [],
                "versions": {name: version(name) for name in ("medor-sim", "medor-cloth", "numpy", "numba", "zarr")},
            }
            zarr.create_group(self.path, attributes=attributes)
        group = zarr.open_group(self.path, mode="r+")
        found: dict[str, Any] = group.attrs.asdict()
        if found.get("plan") != self.plan.record():
            raise DatasetError(f"{self.path} was collected with another plan: {found.get('plan')}")
        running = git_revision()
        if running not in found["revisions"]:
            group.attrs["revisions"] = [*found["revisions"], running]
        shutil.rmtree(self._unfinished, ignore_errors=True)

    @property
    def garments(self) -> range:
        """Its garments."""
        return self.plan.shard(self.index, self.count)

    @property
    def total(self) -> int:
        """Trajectories it will hold."""
        return sum(len(self.plan.trajectories(garment)) for garment in self.garments)

    @property
    def found(self) -> int:
        """Trajectories it holds."""
        records = [self.record(garment) for garment in self.garments]
        return sum(int(record.complete.sum()) for record in records if record)

    def record(self, garment: int) -> GarmentRecord | None:
        """A garment of the shard, to read and to append to; None when it is not there yet."""
        path = self._garment_path(garment)
        return GarmentRecord(zarr.open_group(path, mode="r+"), self.plan.record()) if path.exists() else None

    def add(self, garment: int, scene: Scene) -> GarmentRecord:
        """Writes what all trajectories of a garment share, beside the shard until it is whole.

        Raises:
            DatasetError: the disk is full.
        """
        path = self._garment_path(garment)
        partial = self._unfinished / path.name
        rows = self.plan.trajectories(garment)
        attributes = {"category": scene.garment.category, "seed": scene.garment.seed, "first": rows.start}
        with _full_disk_told():
            group = zarr.create_group(partial, attributes=attributes)
            for name, values in self._shared(scene).items():
                stored = STORED[name].store(values) if name in STORED else values
                group.create_array(name, data=stored, chunks=stored.shape, **LAYOUT)
            group.create_array("complete", shape=(len(rows),), chunks=(1,), dtype=bool, **LAYOUT)
            partial.rename(path)
        return GarmentRecord(zarr.open_group(path, mode="r+"), self.plan.record())

    def _shared(self, scene: Scene) -> dict[str, NDArray]:
        garment, cloth, nodes = scene.garment, scene.solver.cloth, scene.nodes
        arrays = {
            "vertices": garment.vertices,
            "faces": garment.faces,
            "panel_uv": garment.panel_uv,
            "edges": cloth.edges,
            "rest_lengths": cloth.rest_lengths,
            "flat": scene.flat.positions,
        }
        if self.plan.winding:
            arrays["winding"] = winding_grid(scene.nocs, garment.faces, self.plan.winding)
        if self.plan.kind == "dynamics":
            ends = garment.vertices[nodes.ids[nodes.edges]]
            lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
            arrays |= {"node_ids": nodes.ids, "node_edges": nodes.edges, "node_rest_lengths": lengths}
        return {name: values for name, values in arrays.items() if values is not None}

    @property
    def _unfinished(self) -> Path:
        return self.path.with_suffix(".partial")

    def _garment_path(self, garment: int) -> Path:
        return self.path / f"garment-{garment:06d}"


def append(record: GarmentRecord, row: int, arrays: Mapping[str, NDArray]) -> None:
    """Writes one trajectory; it counts once its last array is on disk.

    Raises:
        DatasetError: the disk is full. What was complete before stays so.
    """
    with _full_disk_told():
        for name, values in arrays.items():
            stored = STORED[name].store(values) if name in STORED else np.asarray(values)
            _rows(record, name, stored)[row] = stored
        _rows(record, "complete", np.True_)[row] = True


@contextlib.contextmanager
def _full_disk_told() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise DatasetError("the disk is full; make room and run the same command again to go on") from error


def _rows(record: GarmentRecord, name: str, one: NDArray | np.generic) -> zarr.Array:
    """The array that holds a row of every trajectory; made when the first is written."""
    if name not in record.group:
        shape = (len(record.complete), *one.shape)
        record.group.create_array(name, shape=shape, chunks=(1, *one.shape), dtype=one.dtype, **LAYOUT)
    array = record.group[name]
    assert isinstance(array, zarr.Array)
    return array


def git_revision() -> str:
    """Commit of the code that runs, with `+` when it was changed since; `unknown` outside of a repository."""
    here = Path(__file__).parent
    command = ["git", "-C", str(here), "describe", "--always", "--abbrev=40", "--dirty=+", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
