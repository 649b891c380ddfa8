"""The picker: a point that takes hold of one vertex of the cloth and carries it along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medor_cloth.kernel import kernel

if TYPE_CHECKING:
    from medor_cloth.solver import ClothState, Solver

REACH_M = 0.02125
"""A closing picker grasps the nearest vertex within this distance [m] (MEDOR: threshold + picker + particle radius)."""
PULL_FRAMES = 50
"""Frames of the pull from pick to place."""
SETTLE_FRAMES = 30
"""Frames a released cloth is given to settle."""
SETTLED_SPEED = 0.05
"""Speed below which the cloth counts as settled [m/s]."""


@dataclass(frozen=True)
class Outcome:
    """What came of one pick-and-place.

    Attributes:
        state: The cloth after it.
        grasped: Whether the picker got hold of a vertex.
        frames: Recorded positions (R,V,3) [m]; empty unless recording was asked for.
    """

    state: ClothState
    grasped: bool
    frames: NDArray[np.float32]


def grasp(positions: NDArray[np.float32], picker: ArrayLike) -> int:
    """The vertex a closing picker takes: the nearest within reach, -1 for none.

    Args:
        positions: (V,3) world frame [m].
        picker: Centre of the picker (3,) [m].
    """
    return int(nearest_within_reach(np.asarray(positions, np.float32), np.asarray(picker, np.float32)))


def pull(pick: ArrayLike, place: ArrayLike) -> NDArray[np.float32]:
    """Straight path of the picker at constant speed: its position after each of the pull's frames (T,3) [m]."""
    pick, place = np.asarray(pick, np.float64), np.asarray(place, np.float64)
    share = np.arange(1, PULL_FRAMES + 1)[:, None] / PULL_FRAMES
    return (pick + share * (place - pick)).astype(np.float32)


def pick_place(
    solver: Solver,
    state: ClothState,
    pick: ArrayLike,
    place: ArrayLike,
    *,
    settle_frames: int = SETTLE_FRAMES,
    record_every: int = 0,
) -> Outcome:
    """One pick-and-place of the flying picker (MEDOR, section 4.1): a straight pull, a release in the air, a fall.

    The picker appears at `pick`, closes, moves to `place` in 0.5 s and opens. There is no approach and no lowering.

    Args:
        solver: The cloth's solver.
        state: Where the cloth is now; not modified.
        pick: Centre of the picker where it closes (3,) world frame [m].
        place: Centre of the picker where it opens (3,) world frame [m].
        settle_frames: Longest time given to settle after the release; it ends once the cloth has settled.
        record_every: Record the positions every so many frames, and the last ones; 0 for not at all.
    """
    now = solver.placed(state, pick)
    path, holding = pull(pick, place), np.ones(PULL_FRAMES, bool)
    frames: list[NDArray[np.float32]] = []
    grasped = False
    stride = record_every or PULL_FRAMES
    for begin in range(0, PULL_FRAMES, stride):
        part = slice(begin, begin + stride)
        now = solver.advance(now, len(path[part]), picker_path=path[part], holding=holding[part])
        grasped |= now.held >= 0
        frames.append(now.positions)
    stride = record_every or settle_frames
    for begin in range(0, settle_frames, stride):
        now = solver.advance(now, min(stride, settle_frames - begin), settle_speed=SETTLED_SPEED)
        frames.append(now.positions)
        if now.settled:
            break
    recorded = np.stack(frames) if record_every else np.empty((0, *now.positions.shape), np.float32)
    return Outcome(now, grasped, recorded)


@kernel
def nearest_within_reach(x, picker):
    """Index of the vertex of (V,3) nearest to the picker (3,) if within `REACH_M`, else -1."""
    best, nearest = np.float32(REACH_M * REACH_M), -1
    for i in range(len(x)):
        dx, dy, dz = x[i, 0] - picker[0], x[i, 1] - picker[1], x[i, 2] - picker[2]
        square = dx * dx + dy * dy + dz * dz
        if square <= best:
            best, nearest = square, i
    return nearest
