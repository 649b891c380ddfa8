"""The picker: a point that takes hold of one vertex of the cloth and carries it along."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medor_cloth.engine import Engine
from medor_cloth.solver import ClothState

PULL_FRAMES = 50
"""Frames of the pull from pick to place."""
SETTLE_FRAMES = 100
"""Frames a released cloth is given to settle, at most."""
GLANCE_FRAMES = 30
"""Frames after the release that a rough or learned model foresees (MEDOR, dynamics model): cloth may still move."""
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


def pull(pick: ArrayLike, place: ArrayLike) -> NDArray[np.float32]:
    """Straight path of the picker at constant speed: its position after each of the pull's frames (T,3) [m]."""
    pick, place = np.asarray(pick, np.float64), np.asarray(place, np.float64)
    share = np.arange(1, PULL_FRAMES + 1)[:, None] / PULL_FRAMES
    return (pick + share * (place - pick)).astype(np.float32)


def pick_place(
    solver: Engine,
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
        solver: What moves the cloth.
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
