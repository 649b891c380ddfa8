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
DISAGREEMENT = 0.4
"""Largest difference of a layout from the worn shape over the shape's spread; generated garments stay below 0.25."""


def lay_flat(vertices: NDArray, faces: NDArray, panel_uv: NDArray | None) -> NDArray[np.float32]:
    """Lay a worn garment flat, front up.

    From its panels where they stand upright and side by side as they are worn (a user's panels may be packed in any
    way); otherwise the worn shape is squashed.

    Args:
        vertices: (V, 3) canonical space [m].
        faces: (F, 3), wound outwards.
        panel_uv: (F, 3, 2) [m] or None.

    Returns:
        (V, 3) task space [m]: body up along world +y, bounding box centred on the origin.
    """
    if panel_uv is not None:
        plane = _stitched(faces, panel_uv.astype(np.float64), len(vertices))
        if _agree(plane, vertices[:, [0, 2]]):
            height = CLEARANCE_M + LAYER_GAP_M * (1 + _side(faces, panel_uv, len(vertices))) / 2
            return np.column_stack([_centred(plane), height]).astype(np.float32)
    return squashed(vertices)


def squashed(vertices: NDArray) -> NDArray[np.float32]:
    """Press a worn shape (V, 3) flat, front up; an affine map, so what did not cross still does not.

    Returns:
        (V, 3) task space [m], bounding box centred on the origin.
    """
    y = np.asarray(vertices[:, 1], np.float64)
    squash = min(1.0, SQUASHED_M / max(float(np.ptp(y)), 1e-9))
    height = CLEARANCE_M + (y.max() - y) * squash
    return np.column_stack([_centred(vertices[:, [0, 2]]), height]).astype(np.float32)


def _centred(plane: NDArray) -> NDArray[np.float64]:
    return plane - (plane.max(axis=0) + plane.min(axis=0)) / 2.0


def _agree(plane: NDArray, worn: NDArray) -> bool:
    """Whether a layout is the worn shape seen from the front, up to the change from round to flat."""
    difference = (plane - plane.mean(axis=0)) - (worn - worn.mean(axis=0))
    return bool((difference**2).sum() < DISAGREEMENT**2 * ((worn - worn.mean(axis=0)) ** 2).sum())


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
