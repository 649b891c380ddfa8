"""Rewards of final states: coverage, or closeness to the canonical goals (MEDOR, section IV-C)."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from medor_cloth.alignment import canonical_cost, canonical_cost_unmatched
from medor_cloth.coverage import coverages
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh, Reward, RolloutRequest, Rollouts

DIVERGED_PENALTY = 1e6
"""Taken off the reward of the unmoved cloth when a rollout left the finite numbers: never chosen, still comparable."""


def rated(
    request: RolloutRequest,
    positions: NDArray[np.float32],
    diverged: NDArray[np.bool_],
    *,
    threads: int,
    started: float,
) -> Rollouts:
    """Final states with their rewards. Diverged ones are put back to where the cloth was; in place.

    Args:
        request: what was rolled out.
        positions: (K, V, 3) final states, task space [m].
        diverged: (K,) those that mean nothing.
        threads: how many to use.
        started: reading of `time.perf_counter` when the request came.

    Raises:
        BadRequest: see `rewards`.
    """
    positions[diverged] = request.mesh.vertices
    scores = rewards(positions, request.mesh, request.reward, threads=threads)
    return Rollouts(
        positions=positions,
        rewards=scores - DIVERGED_PENALTY * diverged,
        seconds=time.perf_counter() - started,
    )


def rewards(positions: NDArray[np.float32], mesh: ClothMesh, reward: Reward, *, threads: int) -> NDArray[np.float64]:
    """How good each final state is.

    Args:
        positions: (K, V, 3) final states of the mesh, task space [m].
        mesh: as it was before the action.
        reward: the task and, to canonicalize, its goals. With `visible_only` the vertices that were visible, and the
            faces between them, are all that counts.
        threads: how many to use; the result does not depend on it.

    Returns:
        (K,) coverage [m²], or minus the mean distance to the best goal [m].

    Raises:
        BadRequest: matched goals with another number of vertices than the mesh, or nothing that counts.
    """
    counts = mesh.visible if reward.visible_only else np.ones(len(mesh.vertices), bool)
    if not counts.any():
        raise BadRequest("expected visible vertices to score, got none")
    if reward.task == "flatten":
        return coverages(positions, mesh.faces[counts[mesh.faces].all(axis=1)], threads=threads)
    goals = reward.goals
    if goals is None:
        raise BadRequest("canonicalize needs goals")
    if reward.matched:
        if goals.shape[1] != positions.shape[1]:
            raise BadRequest(f"expected goals of {positions.shape[1]} vertices like the mesh, got {goals.shape[1]}")
        return -canonical_cost(positions[:, counts], goals[:, counts])
    with ThreadPoolExecutor(threads) as pool:
        return -np.array(list(pool.map(lambda state: canonical_cost_unmatched(state, goals), positions[:, counts])))
