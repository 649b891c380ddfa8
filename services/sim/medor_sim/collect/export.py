"""Trajectories in formats that every tool reads."""

from pathlib import Path
from typing import Literal

import numpy as np
import trimesh

from medor_cloth.dataset import Dataset, Trajectory

_PER_GARMENT = ("vertices", "faces", "edges", "rest_lengths", "flat", "node_ids", "node_edges", "node_rest_lengths")
_PER_TRAJECTORY = ("depth", "mask", "nocs", "positions", "moves", "visible", "move", "grasp")


def export(folder: Path, out: Path, form: Literal["npz", "ply"], first: int = 0, count: int | None = None) -> int:
    """Writes trajectories of a data set to a folder; returns how many.

    `npz`: one file a trajectory with all its arrays and its garment's, SI units. `ply`: one file a recorded state, the
    mesh in the world frame coloured by its NOCS.
    """
    out.mkdir(parents=True, exist_ok=True)
    chosen = Dataset(folder).trajectories[first : None if count is None else first + count]
    write = _write_npz if form == "npz" else _write_ply
    for trajectory in chosen:
        write(trajectory, out / f"{trajectory.garment.category}-{trajectory.id:06d}")
    return len(chosen)


def _write_npz(trajectory: Trajectory, stem: Path) -> None:
    record = trajectory.garment
    shared = {name: record[name] for name in _PER_GARMENT if name in record.group}
    own = {name: trajectory[name] for name in _PER_TRAJECTORY if name in record.group}
    names = {"category": record.category, "garment_seed": record.seed, "trajectory": trajectory.id}
    np.savez_compressed(stem.with_suffix(".npz"), **shared, **own, **names)  # type: ignore[arg-type]


def _write_ply(trajectory: Trajectory, stem: Path) -> None:
    record = trajectory.garment
    colours = np.rint(255 * record.box.encode(record["vertices"])).astype(np.uint8)
    for step, positions in enumerate(trajectory["positions"]):
        mesh = trimesh.Trimesh(positions, record["faces"], vertex_colors=colours, process=False)
        mesh.export(stem.with_name(f"{stem.name}-{step:02d}.ply"))
