"""Normalised canonical coordinates: every garment of a category in one unit cube (GarmentNets; MEDOR, section 3.1).

The cube belongs to the category, not to the garment, so that sizes stay comparable: q = (x − c) / (e + 0.1 m) + 0.5
with the centre c and the longest side e of the box around all garments of the training range.

`python -m medor_cloth.nocs` prints the boxes below from the generator (150 CPU-s).
"""

import argparse
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medor_cloth.errors import GarmentError
from medor_cloth.garment import CATEGORIES, generate
from medor_cloth.levels import Levels

MARGIN_M = 0.1
"""Room in the cube beyond the longest side of the box."""
STORED = Levels("uint16", 1 / 65535)
"""How coordinates are stored: steps of less than 10 µm."""


@dataclass(frozen=True)
class NocsBox:
    """The box around all garments of a category in canonical space [m]."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) canonical space [m]; lies at (0.5, 0.5, 0.5) in the cube."""
        return (np.array(self.lower) + self.upper) / 2

    @property
    def side(self) -> float:
        """Side of the cube in canonical space [m]."""
        return float(np.subtract(self.upper, self.lower).max() + MARGIN_M)

    def encode(self, points: ArrayLike) -> NDArray[np.float32]:
        """Canonical points (..., 3) [m] in the cube; all of [0, 1] for the category's garments."""
        return ((np.asarray(points, np.float64) - self.centre) / self.side + 0.5).astype(np.float32)

    def decode(self, coordinates: ArrayLike) -> NDArray[np.float32]:
        """Canonical points (..., 3) [m] of coordinates in the cube."""
        return ((np.asarray(coordinates, np.float64) - 0.5) * self.side + self.centre).astype(np.float32)


NOCS = {
    "trousers": NocsBox((-0.222, -0.062, -0.23), (0.222, 0.062, 0.23)),
    "tshirt": NocsBox((-0.253, -0.074, -0.127), (0.253, 0.074, 0.127)),
    "dress": NocsBox((-0.209, -0.143, -0.197), (0.209, 0.143, 0.197)),
    "skirt": NocsBox((-0.189, -0.151, -0.126), (0.189, 0.151, 0.126)),
    "jumpsuit": NocsBox((-0.191, -0.048, -0.216), (0.191, 0.048, 0.216)),
}


def box_around(category: str, seeds: range, edge_m: float = 0.02) -> NocsBox:
    """The box around generated garments, rounded outwards to the millimetre. Seeds without a garment are left out."""
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for seed in seeds:
        try:
            vertices = generate(category, seed, edge_m).vertices
        except GarmentError:
            continue
        lower, upper = np.minimum(lower, vertices.min(0)), np.maximum(upper, vertices.max(0))
    x0, y0, z0 = (float(x) for x in np.floor(lower * 1000) / 1000)
    x1, y1, z1 = (float(x) for x in np.ceil(upper * 1000) / 1000)
    return NocsBox((x0, y0, z0), (x1, y1, z1))


def main() -> None:
    """Print the boxes of generated garments as the constants of this module."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--garments", type=int, default=300, help="seeds 0 … of each category")
    parser.add_argument("--category", choices=CATEGORIES, nargs="*", default=CATEGORIES)
    options = parser.parse_args()
    for category in options.category:
        box = box_around(category, range(options.garments))
        sys.stdout.write(f'    "{category}": NocsBox({box.lower}, {box.upper}),\n')
        sys.stdout.flush()


if __name__ == "__main__":
    main()
