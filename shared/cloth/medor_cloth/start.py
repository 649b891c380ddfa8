"""Start states: crumpled by a lift and a drop, or by picks at random (MEDOR, section 5.1)."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.coverage import coverage
from medor_cloth.engine import Engine
from medor_cloth.errors import ClothError
from medor_cloth.goals import centred, flattened
from medor_cloth.intersection import self_intersections
from medor_cloth.picker import SETTLED_SPEED, pick_place
from medor_cloth.solver import ClothState

__all__ = ["dropped", "flattened", "picked"]

LIFT_M = (0.3, 0.6)
"""Range of heights the cloth is lifted to."""
LIFT_SPEED = 1.0
"""Speed of the lift [m/s]."""
HANGING_SPEED = 0.1
"""Speed below which a hanging cloth counts as calm [m/s]."""
HOLD_FRAMES = 50
"""Longest time the cloth hangs."""
FALL_FRAMES = 150
"""Longest time it has to come to rest."""
MAX_TRIES = 20
TANGLED_SHARE = 0.01
"""A cloth of which more pairs of faces cross, counted per face, is a tangle that no real one could be."""
VIEW_M = 0.25
"""Cloth farther than this from the origin, along x or y, has left the view of the camera [m]."""
_PICK_LENGTH_M = (0.05, 0.2)


def dropped(
    solver: Engine, flat: ClothState, rng: np.random.Generator, max_coverage: float = 0.7, tries: int = MAX_TRIES
) -> ClothState:
    """The cloth after it was lifted at a vertex drawn at random and let go, at rest under the camera.

    Drawn again until it covers less than a share of the flat cloth and does not run through itself.

    Args:
        solver: What moves the cloth.
        flat: The flattened cloth.
        rng: Source of chance.
        max_coverage: Largest coverage accepted, as a share of the flat one.
        tries: Number of draws before giving up.

    Raises:
        ClothError: If no draw is crumpled enough.
    """
    faces = solver.cloth.faces
    limit, tangled = max_coverage * coverage(flat.positions, faces), TANGLED_SHARE * len(faces)
    for _ in range(tries):
        state = _lift_and_drop(solver, flat, rng)
        if coverage(state.positions, faces) < limit and self_intersections(state.positions, faces) <= tangled:
            return state
    raise ClothError(f"none of {tries} drops covered less than {max_coverage:.0%} of the flat cloth without a tangle")


def picked(solver: Engine, flat: ClothState, rng: np.random.Generator, picks: int = 5) -> ClothState:
    """The flat cloth after pick-and-places drawn at random, at rest.

    Picks that carry a part of the cloth out of the camera's view are drawn again.

    Raises:
        ClothError: If the cloth does not stay in view.
    """
    state = flat
    for _ in range(picks):
        for _ in range(MAX_TRIES):
            pick, place = random_pick(state.positions, rng)
            after = solver.rest(pick_place(solver, state, pick, place).state.positions)
            if np.abs(after.positions[:, :2]).max() < VIEW_M:
                state = after
                break
        else:
            raise ClothError(f"none of {MAX_TRIES} picks kept the cloth in view")
    return state


def random_pick(
    positions: NDArray[np.float32], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A pick at the topmost of the vertices about a random one, and a place 5 to 20 cm from it, level or higher.

    Returns:
        (pick (3,), place (3,)): picker centres, world frame [m].
    """
    vertex = positions[rng.integers(len(positions))]
    column = np.linalg.norm(positions[:, :2] - vertex[:2], axis=1) < 0.006
    pick = positions[np.argmax(np.where(column, positions[:, 2], -1))] + np.array([0, 0, 0.01], np.float32)
    direction = rng.uniform((-0.5, -0.5, 0.0), (0.5, 0.5, 0.5))
    direction *= rng.uniform(*_PICK_LENGTH_M) / np.linalg.norm(direction)
    return pick, (pick + direction).astype(np.float32)


def _lift_and_drop(solver: Engine, flat: ClothState, rng: np.random.Generator) -> ClothState:
    pick = flat.positions[rng.integers(len(flat.positions))]
    height = rng.uniform(*LIFT_M)
    frames = int(np.ceil((height - pick[2]) / (LIFT_SPEED * 0.01)))
    path = np.repeat(pick[None], frames, 0)
    path[:, 2] = np.linspace(pick[2], height, frames + 1)[1:]
    state = solver.advance(solver.placed(flat, pick), frames, picker_path=path, holding=np.ones(frames, bool))
    state = solver.advance(state, HOLD_FRAMES, holding=np.ones(HOLD_FRAMES, bool), settle_speed=HANGING_SPEED)
    state = solver.advance(state, FALL_FRAMES, settle_speed=SETTLED_SPEED)
    return solver.rest(centred(state.positions))
