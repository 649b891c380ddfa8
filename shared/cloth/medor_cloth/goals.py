"""Goal poses: the garment pressed flat, once for every element of its symmetry (MEDOR, section 4.2)."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.cloth import Cloth
from medor_cloth.garment import SYMMETRY_ORDER, Garment
from medor_cloth.solver import ClothState, Solver

PRESS_FRAMES = 150
"""Frames under the press: gravity many times over."""
PRESS_GRAVITY = 100.0
"""Gravity of the press [m/s²]."""
SETTLE_FRAMES = 100
"""Frames at normal gravity after the press."""
SETTLED_SPEED = 0.02
"""Speed below which a flat cloth counts as settled [m/s]."""
_SQUASHED_M = 0.04
"""Front-to-back extent of a worn garment that is laid under the press [m]."""


def solver_of(garment: Garment) -> Solver:
    """A solver with the constants we trust for a garment."""
    return Solver(Cloth.from_mesh(garment.vertices, garment.faces, garment.panel_uv))


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

    The flat layout serves for whole and half turns, lying on its front for the latter. In between the worn shape is
    turned, squashed from front to back and left to the press.
    """
    if element == 0:
        return garment.laid_flat()
    if 2 * element == order:
        return garment.laid_flat() * np.array([-1, 1, -1], np.float32) + np.array([0, 0, 0.02], np.float32)
    angle = 2 * np.pi * element / order
    x, y, z = garment.vertices.astype(np.float64).T
    side, back = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
    height = (back.max() - back) * _SQUASHED_M / np.ptp(back)
    return np.stack([side, z, height], 1).astype(np.float32)
