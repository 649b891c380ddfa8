"""The pixels a completion network is fed: a thinned view, without its image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medor_recon.canonicalized import Canonicalized


@dataclass(frozen=True, eq=False)
class Pixels:
    """P pixels on the cloth, in any order.

    Attributes:
        category: of the garment.
        points: (P, 3) float32 world frame [m].
        nocs: (P, 3) float32 canonical coordinates in [0, 1]³, true or predicted.
        confidence: (P, 3) float32 how sure these are, per axis.
        features: (P, C) float32; C may be 0.
    """

    category: str
    points: NDArray[np.float32]
    nocs: NDArray[np.float32]
    confidence: NDArray[np.float32]
    features: NDArray[np.float32]


def thinned(seen: Canonicalized, spacing: float) -> Pixels:
    """One pixel of each square block of a view, whether all of its pixels are known or only some.

    Args:
        spacing: side of a block, on the table [m]; all pixels if they lie farther apart anyway.
    """
    stride = max(1, round(spacing / pixel_size(seen)))
    rows, columns = seen.pixels.T // stride
    _, kept = np.unique(rows * seen.camera.width + columns, return_index=True)
    return Pixels(seen.category, seen.points[kept], seen.nocs[kept], seen.confidence[kept], seen.features[kept])


def pixel_size(seen: Canonicalized) -> float:
    """Distance of neighbouring pixels on the table [m], for a camera that looks down."""
    return float(seen.camera.position[2] / seen.camera.K[0, 0])
