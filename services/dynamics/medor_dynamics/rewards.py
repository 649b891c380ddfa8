"""Rewards of final states: coverage, or closeness to the canonical goals (MEDOR, section IV-C)."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from medor_cloth.alignment import canonical_cost, canonical_cost_unmatched
from medor_cloth.coverage import coverages
from medor_wire.errors import BadRequest
from medor_wire.messages import Reward


def rewards(
    positions: NDArray[np.float32], faces: NDArray[np.int32], reward: Reward, *, threads: int
) -> NDArray[np.float64]:
    """How good each final state is.

    Args:
        positions: (K, V, 3) final states of one mesh, task space [m].
        faces: (F, 3).
        reward: the task and, to canonicalize, its goals.
        threads: how many to use; the result does not depend on it.

    Returns:
        (K,) coverage [m²], or minus the mean distance to the best goal [m].

    Raises:
        BadRequest: matched goals with another number of vertices than the mesh.
    """
    if reward.task == "flatten":
        return coverages(positions, faces, threads=threads)
    goals = reward.goals
    if goals is None:
        raise BadRequest("canonicalize needs goals")
    if reward.matched:
        if goals.shape[1] != positions.shape[1]:
            raise BadRequest(f"expected goals of {positions.shape[1]} vertices like the mesh, got {goals.shape[1]}")
        return -canonical_cost(positions, goals)
    with ThreadPoolExecutor(threads) as pool:
        return -np.array(list(pool.map(lambda state: canonical_cost_unmatched(state, goals), positions)))
