"""What a judge is taught and examined with: all candidates of all states that were collected."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from medor_planner.judge.features import features
from medor_planner.judge.opinions import OPINIONS
from medor_planner.judge.situation import Outcomes, Situation, load

LOST_M = 0.1
"""Canonical cost of a vertex that leaves the picture, on top of its own [m]."""


@dataclass(frozen=True, eq=False)
class Lessons:
    """All candidates of all states.

    Attributes:
        names: (F) features.
        values: (N, F).
        gains: (N, 2) share of the flat coverage, metres of canonical cost; what has left the picture is lost.
        state: (N,) number of the state.
        garment: (N,) seed of the garment.
    """

    names: tuple[str, ...]
    values: NDArray[np.float32]
    gains: NDArray[np.float32]
    state: NDArray[np.int64]
    garment: NDArray[np.int64]

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Self:
        """All states that were collected, with what all models foresaw."""
        every = [opinion.name for opinion in OPINIONS]
        return cls.of((situation.heard(every), outcomes) for situation, outcomes in stored(paths))

    @classmethod
    def of(cls, states: Iterable[tuple[Situation, Outcomes]]) -> Self:
        """What is known at each state, and what came."""
        names: tuple[str, ...] = ()
        rows, gains, garment = [], [], []
        for situation, outcomes in states:
            names, values = features(situation)
            rows.append(values)
            gains.append(gained(outcomes))
            garment.append(np.full(len(values), outcomes.seed))
        state = np.repeat(np.arange(len(rows)), [len(values) for values in rows])
        return cls(names, np.concatenate(rows), np.concatenate(gains), state, np.concatenate(garment))

    def __len__(self) -> int:
        return len(self.values)

    def where(self, chosen: NDArray) -> Self:
        """Some of the candidates, by number or by mask."""
        parts = {name: getattr(self, name)[chosen] for name in ("values", "gains", "state", "garment")}
        return replace(self, **parts)


def stored(paths: Sequence[Path]) -> Iterator[tuple[Situation, Outcomes]]:
    """What `medor_planner.judge.collect` wrote, with a bar."""
    return (load(path) for path in track(paths, "lessons", console=Console(stderr=True), transient=True))


def gained(outcomes: Outcomes) -> NDArray[np.float32]:
    """(K, 2) what the candidates brought."""
    covered = outcomes.coverage_m2 * outcomes.in_view / outcomes.flat_coverage_m2
    cost = outcomes.cost_m + LOST_M * (1 - outcomes.in_view)
    return np.stack([covered[1:] - covered[0], cost[0] - cost[1:]], axis=1).astype(np.float32)
