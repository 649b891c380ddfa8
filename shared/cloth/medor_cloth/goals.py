"""Goal poses: the garment pressed flat, once for every element of its symmetry (MEDOR, section 4.2)."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.cloth import Cloth
from medor_cloth.garment import SYMMETRY_ORDER, Garment
from medor_cloth.solver import ClothState, Solver, SolverConfig

PRESS_FRAMES = 150
"""Frames under the press: gravity many times over."""
PRESS_GRAVITY = 100.0
"""Gravity of the press [m/s²]."""
SETTLE_FRAMES = 100
"""Frames at normal gravity after the press."""
SETTLED_SPEED = 0.02
"""Speed below which a flat cloth counts as settled [m/s]."""


def solver_of(garment: Garment, config: SolverConfig | None = None) -> Solver:
    """A solver for a garment, with the constants we trust unless others are given."""
    return Solver(Cloth.from_mesh(garment.vertices, garment.faces, garment.panel_uv), config)


def goal_set(garment: Garment, solver: Solver | None = None) -> NDArray[np.float32]:
    """The garment flat on the table, turned about its body axis by 360°/S·i for each i < S: (S,V,3) world frame [m].

    For trousers, dresses and jumpsuits the second pose lies on its front; for a skirt the tube is spun. Turns within
    the table plane are not goals of their own: the cost aligns them away.
    """
    solver = solver or solver_of(garment)
    order = SYMMETRY_ORDER[garment.category]
    return np.stack([pressed(solver, turned(garment, i, order)).positions for i in range(order)])


def flattened(garment: Garment, solver: Solver | None = None) -> ClothState:
    """The garment flat on the table, front up, pressed and at rest: where its coverage is largest."""
    return pressed(solver or solver_of(garment), garment.laid_flat())


def pressed(solver: Solver, layout: NDArray[np.float32]) -> ClothState:
    """A layout (V,3) [m] flattened under super-gravity, settled at normal gravity and centred under the camera."""
    state = solver.advance(
        solver.rest(centred(layout)), PRESS_FRAMES, gravity=PRESS_GRAVITY, settle_speed=SETTLED_SPEED
    )
    state = solver.advance(solver.rest(state.positions), SETTLE_FRAMES, settle_speed=SETTLED_SPEED)
    return solver.rest(centred(state.positions))


def centred(positions: NDArray[np.float32]) -> NDArray[np.float32]:
    """The same cloth (V,3) with its mean under the camera."""
    middle = positions.mean(0)
    middle[2] = 0
    return positions - middle


def turned(garment: Garment, element: int, order: int) -> NDArray[np.float32]:
    """A layout (V,3) world frame [m] of the garment turned by element/order of a full turn about its body axis.

    The flat layout is taken for a flattened cone, which a skirt is: its layers are sectors about the apex where the
    side seams meet, and a turn moves each vertex around the apex, over the fold at the seam and on to the other layer.
    """
    layout = garment.laid_flat()
    if element == 0:
        return layout
    if 2 * element == order:
        both = layout[:, 2].min() + layout[:, 2].max()
        return layout * np.array([-1, 1, -1], np.float32) + np.array([0, 0, both], np.float32)
    x, y, z = layout.astype(np.float64).T
    apex = _apex(x, y)
    radius, angle = np.hypot(x, apex - y), np.arctan2(x, apex - y)
    widest = np.abs(angle).max()
    front = z > (z.min() + z.max()) / 2
    around = np.where(front, 1 + angle / widest, 3 - angle / widest) / 4  # front left to right, then back to left
    around = (around + element / order) % 1
    angle = widest * np.where(around < 0.5, 4 * around - 1, 3 - 4 * around)
    height = np.where(around < 0.5, z.max(), z.min())
    return np.stack([radius * np.sin(angle), apex - radius * np.cos(angle), height], 1).astype(np.float32)


def _apex(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Where above the body axis the sides of a flat layout would meet [m]; far off for straight sides."""
    bands = np.linspace(y.min(), y.max(), 7)
    band = np.clip(np.digitize(y, bands) - 1, 0, 5)
    ends = [np.flatnonzero(band == k)[np.abs(x[band == k]).argmax()] for k in range(6) if (band == k).any()]
    slope, width = np.polyfit(y[ends], np.abs(x[ends]), 1)
    return float(-width / min(slope, -1e-3))
