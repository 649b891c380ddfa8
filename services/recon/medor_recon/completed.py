"""A whole mesh made from one view: the record between completion and what comes after it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Completed:
    """A garment's complete mesh in both spaces, vertices in correspondence.

    Attributes:
        canonical: (V, 3) float32 canonical space [m].
        faces: (F, 3) int32.
        positions: (V, 3) float32 world frame [m].
    """

    canonical: NDArray[np.float32]
    faces: NDArray[np.int32]
    positions: NDArray[np.float32]
