"""How long episodes take, by method, and so how long the rest will."""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from benchmarks.episodes import Variant
from benchmarks.protocol import Trial
from benchmarks.results import Line


class Pace:
    """Seconds of the episodes so far. Methods differ a hundredfold, so each is judged by its own."""

    def __init__(self, lines: Iterable[Line]) -> None:
        seconds: dict[str, float] = defaultdict(float)
        for line in lines:
            seconds[line["key"]] += line["seconds"]
        self._spent: dict[Variant, list[float]] = defaultdict(list)
        for key, spent in seconds.items():
            self.add(Trial.of(key), spent)

    def add(self, trial: Trial, seconds: float) -> None:
        self._spent[Variant.of(trial)].append(seconds)

    def left(self, trials: Iterable[Trial]) -> float | None:
        """What these will take [s]; a method not met before takes the mean of the others. None before any episode."""
        means = {variant: float(np.mean(spent)) for variant, spent in self._spent.items()}
        if not means:
            return None
        other = float(np.mean(list(means.values())))
        return sum(means.get(Variant.of(trial), other) for trial in trials)
