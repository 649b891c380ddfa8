"""Flat layouts of a garment on the table: where a simulation starts."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

LAYER_GAP_M = 0.0055
"""Height between the back and the front of a garment lying flat; more than the cloth's thickness of 5 mm."""
CLEARANCE_M = 0.0025
"""Height of the lowest layer's middle surface above the table: half the cloth's thickness."""
SQUASHED_M = 0.015
"""Height of a squashed worn shape, whose layers are not known."""


def laid_from_panels(faces: NDArray, panel_uv: NDArray, n_vertices: int) -> NDArray[np.float32]:
    """Lay a generated garment flat: front panels above back panels, seams halfway between.

    Args:
        faces: (F, 3).
        panel_uv: (F, 3, 2) [m], upright panels; counter-clockwise on the front, clockwise on the back.
        n_vertices: V.

    Returns:
        (V, 3) task space [m]: panel y along world +y, bounding box centred on the origin.
    """
    plane = _stitched(faces, panel_uv.astype(np.float64), n_vertices)
    plane -= (plane.max(axis=0) + plane.min(axis=0)) / 2
    height = CLEARANCE_M + LAYER_GAP_M * (1 + _side(faces, panel_uv, n_vertices)) / 2
    return np.column_stack([plane, height]).astype(np.float32)


def squashed(vertices: NDArray) -> NDArray[np.float32]:
    """Press a worn shape (V, 3) flat, front up; an affine map, so what did not cross still does not.

    Returns:
        (V, 3) task space [m], bounding box centred on the origin.
    """
    x, y, z = (np.asarray(vertices, np.float64) - np.mean([vertices.min(axis=0), vertices.max(axis=0)], axis=0)).T
    squash = SQUASHED_M / max(float(np.ptp(y)), 1e-9)
    height = CLEARANCE_M + (y.max() - y) * min(squash, 1.0)
    return np.column_stack([x, z, height]).astype(np.float32)


def _side(faces: NDArray, panel_uv: NDArray, n: int) -> NDArray[np.float64]:
    """(V,) +1 on front panels, −1 on back panels, 0 where they are sewn together."""
    a, b, c = (panel_uv[:, k] for k in range(3))
    turn = np.sign((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    mean = np.bincount(faces.ravel(), np.repeat(turn, 3), n) / np.bincount(faces.ravel(), minlength=n)
    return np.trunc(mean)


def _stitched(faces: NDArray, panel_uv: NDArray, n: int) -> NDArray[np.float64]:
    """(V, 2) places whose edge vectors differ least, in squares, from the panels'.

    Edge vectors forget where each panel was drawn, so panels sewn along different curves (a skirt's arc on a straight
    waist) meet halfway and the difference fades smoothly into both.
    """
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    wanted = (np.roll(panel_uv, -1, axis=1) - panel_uv).reshape(-1, 2)
    rows = np.repeat(np.arange(len(ends)), 2)
    signs = np.tile([-1.0, 1.0], len(ends))
    difference = sparse.coo_array((signs, (rows, ends.ravel())), shape=(len(ends), n)).tocsr()[:, 1:]
    places = splu((difference.T @ difference).tocsc()).solve(difference.T @ wanted)
    return np.vstack([np.zeros((1, 2)), places])  # the first vertex is held, the rest follows
