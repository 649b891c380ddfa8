"""Normalized improvement (NI): how much of the way from the start to the best possible was gone.

0 is the start, 1 the best. One episode's values are never clipped; only `quartiles` clips, when many episodes are
put together, as in the published tables.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def normalized_improvement_flatten(cov: ArrayLike, cov_init: ArrayLike, cov_flat: ArrayLike) -> np.ndarray:
    """(cov - cov_init) / (cov_flat - cov_init) of coverages [m²], broadcast; above 1 beyond the flat pose.

    Raises:
        ValueError: the start covers as much as the flat garment, so nothing can be measured.
    """
    cov, cov_init, cov_flat = (np.asarray(value, np.float64) for value in (cov, cov_init, cov_flat))
    if not (cov_init < cov_flat).all():
        raise ValueError(f"expected a start that covers less than flat, got {cov_init} of {cov_flat} m²")
    return (cov - cov_init) / (cov_flat - cov_init)


def normalized_improvement_canonical(cost: ArrayLike, cost_init: ArrayLike) -> np.ndarray:
    """1 - cost / cost_init of canonical costs [m], broadcast; below 0 when farther from the goal than at first.

    Raises:
        ValueError: the start is the goal already, so nothing can be measured.
    """
    cost, cost_init = np.asarray(cost, np.float64), np.asarray(cost_init, np.float64)
    if not (cost_init > 0).all():
        raise ValueError(f"expected a start away from the goal, got a cost of {cost_init} m")
    return 1 - cost / cost_init


def carried_forward(values: ArrayLike, picks: int) -> np.ndarray:
    """(picks + 1,) float64: an episode's values from the start on; one that stopped early keeps its last.

    Args:
        values: (n,) values after 0, 1, … n - 1 picks, 1 <= n <= picks + 1.
        picks: the most picks an episode may take.
    """
    values = np.asarray(values, np.float64)
    if not 1 <= len(values) <= picks + 1:
        raise ValueError(f"expected 1 to {picks + 1} values for at most {picks} picks, got {len(values)}")
    return np.pad(values, (0, picks + 1 - len(values)), mode="edge")


def quartiles(values: ArrayLike) -> np.ndarray:
    """(3, ...) lower quartile, median and upper quartile over the first axis (episodes), values clipped at 1."""
    return np.quantile(np.minimum(np.asarray(values, np.float64), 1.0), (0.25, 0.5, 0.75), axis=0)
