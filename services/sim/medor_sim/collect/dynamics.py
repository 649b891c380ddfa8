"""Trajectories for learning how cloth moves: one pull of the picker and the fall after it (MEDOR, section 5.2)."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import overhead
from medor_cloth.dataset import FRAMES_PER_STEP
from medor_cloth.picker import PULL_FRAMES, pull
from medor_cloth.raster import visible_vertices
from medor_cloth.solver import ClothState
from medor_cloth.start import dropped, picked
from medor_sim.collect.scene import Scene

CAMERA = overhead(200)
FREE_FRAMES = 30
LENGTH_M = (0.05, 0.4)
"""Of a pull, least and most [m]: MEDOR records from 15 cm, its planner asks for 5 to 20 cm; both are here."""
PICKER_ABOVE_M = 0.01
"""Height of the picker's centre over the vertex it aims at [m]."""
PER_START = 2
"""Trajectories from each start state."""
DROPPED_SHARE = 0.5
PICKS = (1, 5)
"""How many picks at least and at most make a start state that is not dropped."""


def start(scene: Scene, rng: np.random.Generator) -> ClothState:
    """A crumpled state: dropped, or picked at from flat."""
    if rng.random() < DROPPED_SHARE:
        return dropped(scene.solver, scene.flat, rng)
    return picked(scene.solver, scene.flat, rng, picks=int(rng.integers(PICKS[0], PICKS[1] + 1)))


def trajectory(scene: Scene, state: ClothState, rng: np.random.Generator) -> dict[str, NDArray] | None:
    """One trajectory's arrays, named and shaped as `medor_cloth.dataset` says, in SI units.

    Returns:
        None when the picker got hold of nothing.
    """
    visible = visible_vertices(state.positions, scene.garment.faces, CAMERA)[scene.nodes.ids]
    node = int(rng.choice(np.flatnonzero(visible)))
    pick = state.positions[scene.nodes.ids[node]] + np.array([0, 0, PICKER_ABOVE_M], np.float32)
    place = random_place(pick, rng)
    frames, held = _pulled(scene, state, pick, place)
    if held < 0:
        return None
    return {
        "positions": frames,
        "visible": visible,
        "move": np.stack([pick, place]),
        "grasp": np.array([node, held], np.int32),
    }


def random_place(pick: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Where a pull ends (3,) [m]: 5 to 40 cm away, level or higher, seen by the camera."""
    while True:
        direction = rng.uniform((-0.5, -0.5, 0.0), (0.5, 0.5, 0.5))
        place = pick + rng.uniform(*LENGTH_M) * direction / np.linalg.norm(direction)
        if CAMERA.contains(place):
            return place.astype(np.float32)


def _pulled(
    scene: Scene, state: ClothState, pick: NDArray[np.float32], place: NDArray[np.float32]
) -> tuple[NDArray[np.float32], int]:
    """Positions before the pull and every fifth frame of it and of the fall (17, V, 3) [m], and the vertex held.

    Unlike a candidate of the planner the fall is never cut short: the time between two records is always the same.
    """
    path = np.concatenate([pull(pick, place), np.tile(place, (FREE_FRAMES, 1))])
    closed = np.arange(len(path)) < PULL_FRAMES
    now, held, frames = scene.solver.placed(state, pick), -1, [state.positions]
    for begin in range(0, len(path), FRAMES_PER_STEP):
        part = slice(begin, begin + FRAMES_PER_STEP)
        now = scene.solver.advance(now, FRAMES_PER_STEP, picker_path=path[part], holding=closed[part])
        held = max(held, now.held)
        frames.append(now.positions)
    return np.stack(frames), held
