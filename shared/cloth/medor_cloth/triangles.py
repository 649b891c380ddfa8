"""Shape of single triangles."""

import numpy as np
from numpy.typing import NDArray


def smallest_angle_deg(corners: NDArray[np.floating]) -> float:
    """The smallest angle of all triangles (F, 3, D) [degrees]."""
    to_next, to_last = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    sizes = np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2)
    cosine = (to_next * to_last).sum(axis=2) / np.maximum(sizes, 1e-30)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).min())
