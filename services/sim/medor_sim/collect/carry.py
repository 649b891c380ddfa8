"""Carrying: the cloth is lifted at a point, brought over another, lowered and let go (MEDOR, section 5.1)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera
from medor_cloth.picker import SETTLED_SPEED
from medor_cloth.raster import Raster
from medor_cloth.solver import ClothState, Solver
from medor_sim.collect.harris import harris_corners

CORNER_SHARE = 0.9
"""How often the cloth is taken at a corner of its silhouette rather than anywhere."""
DISTANCE_PX = (25.0, 150.0)
PLACE_PX = (25.0, 175.0)
"""Places are clipped to these rows and columns."""
HEIGHT_M = (0.05, 0.1)
SPEED_M = 0.005
"""Way of the picker a frame [m]."""
ABOVE_SURFACE_M = 0.005
"""Height of the picker's centre over the surface it takes hold of or lays down on [m]."""
SETTLE_FRAMES = 40
"""Longest time the cloth is given to settle; half of it then lies within 1 mm of where it is 0.6 s later."""


class Carry(NamedTuple):
    """A carry of the picker, world frame [m]."""

    pick: NDArray[np.float64]
    place: NDArray[np.float64]
    height: float


def random_carry(view: Raster, camera: Camera, rng: np.random.Generator) -> Carry:
    """A carry as a person unfolding might try, drawn from what a 200 px camera sees.

    Two points of the cloth are drawn, mostly at its corners. The first moves at right angles to the line between them,
    turned towards the middle of the image: what MEDOR's two arms do together, done by one.
    """
    corners = harris_corners(view.mask)
    mask = corners if rng.random() < CORNER_SHARE and corners.sum() > 2 else view.mask
    here, there = np.argwhere(mask)[rng.choice(int(mask.sum()), 2, replace=False)] + 0.5
    row, column = there - here
    direction = np.array([-column, row]) / np.hypot(row, column)
    if direction @ (np.array(view.mask.shape) / 2 - here) < 0:
        direction = -direction
    target = np.clip(here + rng.uniform(*DISTANCE_PX) * direction, *PLACE_PX)
    return Carry(_over(view, camera, here), _over(view, camera, target), float(rng.uniform(*HEIGHT_M)))


def carry(solver: Solver, state: ClothState, move: Carry) -> ClothState | None:
    """The cloth at rest after a carry; None when the picker got hold of nothing."""
    path = carry_path(move)
    closed = np.ones(len(path), bool)
    carried = solver.advance(solver.placed(state, move.pick), len(path), picker_path=path, holding=closed)
    if carried.held < 0:
        return None
    return solver.rest(solver.advance(carried, SETTLE_FRAMES, settle_speed=SETTLED_SPEED).positions)


def carry_path(move: Carry) -> NDArray[np.float32]:
    """Where the picker is after each frame (T, 3) [m]: straight up, across, straight down."""
    up, over = move.pick.copy(), move.place.copy()
    up[2] = over[2] = max(move.height, move.pick[2], move.place[2])
    corners = np.stack([move.pick, up, over, move.place])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    frames = max(1, int(np.ceil(way[-1] / SPEED_M)))
    along = np.linspace(0, way[-1], frames + 1)[1:]
    return np.stack([np.interp(along, way, axis) for axis in corners.T], axis=1).astype(np.float32)


def _over(view: Raster, camera: Camera, pixel: NDArray[np.float64]) -> NDArray[np.float64]:
    """The picker's centre over what is seen at an image point (row, column), cloth or table (3,) [m]."""
    row, column = np.minimum(pixel.astype(int), np.array(view.depth.shape) - 1)
    depth = view.depth[row, column] or camera.position[2]
    ray = camera.T_world_camera[:3, :3] @ camera.K_inverse @ [pixel[1], pixel[0], 1.0]
    return camera.position + ray * depth + [0, 0, ABOVE_SURFACE_M]
