"""Publish weights: `python -m medor_learn.ship runs/canonical/best services/recon/medor_recon/weights/canonical-cpu`.

Stored as float16 they are half as large; config, card and whatever else is in the folder come along.
"""

import sys
from pathlib import Path

import tyro

from medor_learn import weights


def main(folder: tyro.conf.Positional[Path], to: tyro.conf.Positional[Path]) -> None:
    """Copy a folder of weights to where it is published.

    Args:
        folder: as training leaves it in `best`.
        to: the new folder.
    """
    weights.ship(folder, to)
    size = sum(file.stat().st_size for file in to.iterdir())
    sys.stdout.write(f"{to}: {size / 1e6:.1f} MB\n")


if __name__ == "__main__":
    tyro.cli(main)
