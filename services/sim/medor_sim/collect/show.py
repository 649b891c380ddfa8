"""A moving picture of one trajectory."""

from pathlib import Path

from medor_cloth.camera import overhead
from medor_cloth.dataset import FRAMES_PER_STEP, Dataset
from medor_cloth.film import film, gif_bytes, png_strip_bytes

CAMERA = overhead(360)
RECON_S = 1.0
"""Time each observation is shown [s]."""
SLOWER = 3.0
"""How much slower than life a pull is shown."""


def show(folder: Path, index: int, out: Path) -> None:
    """Writes the trajectory at an index of a data set as `.gif`, or as `.png`: its states side by side.

    Raises:
        ValueError: any other ending.
    """
    dataset = Dataset(folder)
    trajectory = dataset[index]
    pictures = film(trajectory["positions"], trajectory.garment["faces"], CAMERA)
    if out.suffix == ".gif":
        seconds = RECON_S if dataset.kind == "recon" else SLOWER * FRAMES_PER_STEP * 0.01
        out.write_bytes(gif_bytes(pictures, seconds))
    elif out.suffix == ".png":
        out.write_bytes(png_strip_bytes(pictures))
    else:
        raise ValueError(f"expected a name ending in .gif or .png, got {out.name}")
