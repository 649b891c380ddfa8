"""What is known of the visible cloth once its pixels have canonical coordinates: the record between the networks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera


@dataclass(frozen=True, eq=False)
class Canonicalized:
    """The pixels on the cloth of one view, P of them.

    Attributes:
        category: of the garment; `medor_cloth.nocs.NOCS[category].decode(nocs)` gives metres in canonical space.
        pixels: (P, 2) int32 row and column in the network's image.
        points: (P, 3) float32 where they are, world frame [m].
        nocs: (P, 3) float32 predicted canonical coordinates in [0, 1]³.
        confidence: (P, 3) float32 probability of the chosen bin, per axis.
        features: (P, C) float32 of the network; C may be 0.
        camera: of the network's image.
    """

    category: str
    pixels: NDArray[np.int32]
    points: NDArray[np.float32]
    nocs: NDArray[np.float32]
    confidence: NDArray[np.float32]
    features: NDArray[np.float32]
    camera: Camera
