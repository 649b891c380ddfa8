"""How well something rates the candidates of states that it has not seen."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.stats import rankdata

from medor_planner.judge.judge import TASKS
from medor_planner.judge.lessons import Lessons
from medor_planner.judge.opinions import OPINIONS

FEW = 8
"""A glance is judged by the best one in so many of the candidates whose outcome is known."""


@dataclass(frozen=True)
class Merit:
    """How well something rates the candidates of a state, mean over states.

    Attributes:
        rank: Spearman correlation with what they brought.
        gain: what its favourite brought, 0 where it likes nothing better than doing nothing.
        error: standard error of that.
    """

    rank: float
    gain: float
    error: float


def merit(ratings: NDArray, gains: NDArray, state: NDArray[np.int64]) -> Merit:
    """Of ratings (N,), where 0 is doing nothing."""
    ranks, favourites = [], []
    for one in np.unique(state):
        rated, brought = ratings[state == one], gains[state == one]
        differ = np.ptp(rated) > 0 and np.ptp(brought) > 0
        ranks.append(np.corrcoef(rankdata(rated), rankdata(brought))[0, 1] if differ else 0.0)
        favourites.append(brought[rated.argmax()] if rated.max() > 0 else 0.0)
    return Merit(
        round(float(np.mean(ranks)), 4),
        round(float(np.mean(favourites)), 5),
        round(float(np.std(favourites)) / len(favourites) ** 0.5, 5),
    )


def compared(data: Lessons, expected: dict[str, NDArray[np.float32]]) -> dict[str, dict[str, Merit]]:
    """By task: each judge's merit, each model's, and that of knowing."""
    found: dict[str, dict[str, Merit]] = {}
    for column, (task, feature) in enumerate(zip(TASKS, ("gain", "nearer"), strict=True)):
        gains = data.gains[:, column]
        ratings = {name: gain[:, column] for name, gain in expected.items()}
        ratings |= {it.name: data.values[:, data.names.index(f"{it.name} {feature}")] for it in OPINIONS}
        ratings["the outcome itself"] = gains
        found[task] = {name: merit(rating, gains, data.state) for name, rating in ratings.items()}
    return found


def table(found: dict[str, dict[str, Merit]]) -> Table:
    out = Table("task", "rated by", "rank correlation", "its favourite brings")
    for task, merits in found.items():
        for name, one in merits.items():
            out.add_row(task, name, f"{one.rank:.3f}", f"{one.gain:.4f} ± {one.error:.4f}")
    return out


def best_few(ratings: NDArray, gains: NDArray, state: NDArray[np.int64]) -> float:
    """What the few of a state's candidates that ratings like best bring on average, mean over states."""
    means = []
    for one in np.unique(state):
        rated, brought = ratings[state == one], gains[state == one]
        means.append(brought[np.argsort(-rated)[: max(len(rated) // FEW, 1)]].mean())
    return round(float(np.mean(means)), 5)
