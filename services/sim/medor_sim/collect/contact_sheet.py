"""A data set at a glance: observations of some trajectories as one picture."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import overhead
from medor_cloth.dataset import Dataset, Trajectory
from medor_cloth.picture import depth_picture, png_bytes, shade
from medor_cloth.portrait import with_arrow
from medor_cloth.raster import rasterize

CAMERA = overhead(200)
GAP_PX = 4


def write_contact_sheet(folder: Path, path: Path, trajectories: int = 4) -> None:
    """Writes a PNG of trajectories spread over a data set; see `recon_rows` and `dynamics_rows` for what it shows."""
    dataset = Dataset(folder)
    chosen = [dataset[int(k)] for k in np.linspace(0, len(dataset) - 1, min(trajectories, len(dataset)))]
    rows = recon_rows if dataset.kind == "recon" else dynamics_rows
    path.write_bytes(png_bytes(tiled([row for one in chosen for row in rows(one)])))


def recon_rows(trajectory: Trajectory) -> list[list[NDArray[np.uint8]]]:
    """Three rows of five observations: depth with the next action; the cloth lit from a side; NOCS as colours.

    The colours run from end to end of the garment.
    """
    depth, nocs, moves = trajectory["depth"], trajectory["nocs"], trajectory["moves"]
    heights = [depth_picture(one) for one in depth]
    following = [with_arrow(picture, move, CAMERA) for picture, move in zip(heights, moves[1:], strict=False)]
    faces = trajectory.garment["faces"]
    lit = [shade(rasterize(positions, faces, CAMERA), CAMERA) for positions in trajectory["positions"]]
    own = trajectory.garment.box.encode(trajectory.garment["vertices"])
    bright = (nocs - own.min(0)) / np.ptp(own, axis=0) * trajectory["mask"][..., None]
    return [following + heights[-1:], lit, list(np.rint(255 * np.clip(bright, 0, 1)).astype(np.uint8))]


def dynamics_rows(trajectory: Trajectory) -> list[list[NDArray[np.uint8]]]:
    """The cloth lit from a side at eight times from before the pull, with its arrow, to the end."""
    positions, faces = trajectory["positions"], trajectory.garment["faces"]
    chosen = positions[np.linspace(0, len(positions) - 1, 8).round().astype(int)]
    lit = [shade(rasterize(one, faces, CAMERA), CAMERA) for one in chosen]
    return [[with_arrow(lit[0], trajectory["move"], CAMERA), *lit[1:]]]


def tiled(rows: Sequence[Sequence[NDArray[np.uint8]]]) -> NDArray[np.uint8]:
    """Pictures (H, W, 3) of one size as one, row by row."""
    return np.concatenate([_padded(np.concatenate([_padded(one) for one in row], axis=1)) for row in rows])


def _padded(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.pad(picture, ((0, GAP_PX), (0, GAP_PX), (0, 0)))
