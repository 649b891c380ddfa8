"""Many pick-and-places from one state, side by side: what random shooting asks of a simulator."""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medor_cloth.errors import ClothError
from medor_cloth.picker import SETTLE_FRAMES, pick_place
from medor_cloth.solver import ClothState, Solver


class Cancelled(ClothError):
    """The caller asked to stop before all rollouts were done."""


def rollouts(
    solver: Solver,
    state: ClothState | ArrayLike,
    picks: ArrayLike,
    places: ArrayLike,
    *,
    settle_frames: int = SETTLE_FRAMES,
    threads: int = 0,
    cancelled: Callable[[], bool] | None = None,
    on_done: Callable[[int], None] | None = None,
) -> NDArray[np.float32]:
    """Positions after each of K pick-and-places from the same state: (K,V,3) world frame [m].

    Args:
        solver: The cloth's solver.
        state: Where the cloth is, or its positions at rest (V,3) [m].
        picks: Picker centres where it closes (K,3) [m].
        places: Picker centres where it opens (K,3) [m].
        settle_frames: Longest time each cloth gets to settle after the release.
        threads: How many to use; 0 means every processor. The result does not depend on it.
        cancelled: Asked before each rollout; once true, no further one is started.
        on_done: Told the number of finished rollouts after each one, from any thread but never twice at a time.

    Raises:
        Cancelled: If `cancelled` said so.
        ClothError: If picks and places do not fit.
    """
    picks, places = np.asarray(picks, np.float32), np.asarray(places, np.float32)
    if picks.ndim != 2 or picks.shape[1] != 3 or picks.shape != places.shape:
        raise ClothError(f"expected picks and places (K, 3), got {picks.shape} and {places.shape}")
    start = state if isinstance(state, ClothState) else solver.rest(state)
    after = np.empty((len(picks), *start.positions.shape), np.float32)
    stop, counting = threading.Event(), threading.Lock()
    done = 0

    def roll(k: int) -> None:
        nonlocal done
        if stop.is_set() or (cancelled is not None and cancelled()):
            stop.set()
            return
        after[k] = pick_place(solver, start, picks[k], places[k], settle_frames=settle_frames).state.positions
        with counting:
            done += 1
            if on_done is not None:
                on_done(done)

    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        list(pool.map(roll, range(len(picks))))
    if stop.is_set():
        raise Cancelled(f"stopped after {done} of {len(picks)} rollouts")
    return after
