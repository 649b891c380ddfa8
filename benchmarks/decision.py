"""One plan's candidates as two models see them, and what screening would have made of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

NOTHING = -1
"""Stands for doing nothing where candidates are numbered."""


@dataclass(frozen=True)
class Decision:
    """One plan's candidates, numbered from the best by the method's own model to the worst.

    Attributes:
        model: (K,) rewards by that model, falling.
        screen: (K,) rewards by the screen.
        chance: (K,) random numbers.
        nothing: reward of doing nothing, by the model.
        true: by the cloth solver, of the candidates that any share of survivors chooses.
        planned: the planner's choice, screening as it is set.
        exhaustive_s: time of all rollouts [s].
        screen_s: of rating all candidates, shared by the replicas [s].
        planned_s: of the planner's screening and rollouts [s].
    """

    model: NDArray[np.float64]
    screen: NDArray[np.float64]
    chance: NDArray[np.float64]
    nothing: float
    true: Mapping[int, float]
    planned: int
    exhaustive_s: float
    screen_s: float
    planned_s: float

    @cached_property
    def best(self) -> int:
        return chosen(self.model, self.model, self.nothing, 1.0)

    def loss(self, rating: NDArray[np.float64], keep: float) -> tuple[float, float]:
        """Reward given away by rolling out the best by a rating only: by the model and by the solver, as shares."""
        return self.loss_of(chosen(self.model, rating, self.nothing, keep))

    def loss_of(self, choice: int) -> tuple[float, float]:
        """Reward given away by a choice: by the model and by the solver, as shares."""
        by_model = {NOTHING: self.nothing, **dict(enumerate(self.model.tolist()))}
        return given_away(by_model, self.best, choice), given_away(self.true, self.best, choice)

    def seconds(self, keep: float) -> float:
        return self.screen_s + survivors(len(self.model), keep) / len(self.model) * self.exhaustive_s


def given_away(rewards: Mapping[int, float], best: int, choice: int) -> float:
    """By how much of its reward the best is better than a choice."""
    return (rewards[best] - rewards[choice]) / abs(rewards[best])


def survivors(count: int, keep: float) -> int:
    return int(np.ceil(keep * count))


def chosen(model: NDArray[np.float64], rating: NDArray[np.float64], nothing: float, keep: float) -> int:
    """The best by the model of the best by a rating; `NOTHING` where none of them beats doing nothing."""
    left = np.argsort(-rating, kind="stable")[: survivors(len(rating), keep)]
    first = int(left[model[left].argmax()])
    return first if model[first] > nothing else NOTHING
