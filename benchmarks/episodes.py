"""Finished episodes of one or several results files, as the tables want them."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.protocol import Trial
from benchmarks.published import METHODS
from benchmarks.results import Line
from medor_cloth.improvement import carried_forward


class Variant(NamedTuple):
    """What is compared: a method under the conditions it ran, with so many candidates a pick."""

    label: str
    candidates: int

    @classmethod
    def of(cls, trial: Trial) -> "Variant":
        return cls(trial.label, trial.candidates)

    @property
    def place(self) -> tuple[int, str, int]:
        """Where it stands in tables: as in the list of all methods, others after them."""
        method = self.label.split(" (")[0]
        return METHODS.index(method) if method in METHODS else len(METHODS), self.label, self.candidates


@dataclass(frozen=True)
class Episode:
    """One episode: what it was and what it reached."""

    trial: Trial
    ni: NDArray[np.float64]
    """After 0, 1, … picks, (picks + 1,); one that ended early keeps its last value. Clipped at 1, as published."""
    seconds: tuple[float, ...]
    """Of each pick that was made."""
    gave_up: str = ""
    """Code of the error that ended it: the method could not go on."""
    commit: str = ""
    """Of the source that ran it."""

    @cached_property
    def variant(self) -> Variant:
        return Variant.of(self.trial)

    @property
    def cell(self) -> tuple[str, str]:
        """Of the published tables."""
        return self.trial.task, self.trial.category

    @property
    def question(self) -> tuple[str, str, int]:
        """Task and crumpled garment: what different methods answer alike."""
        return self.trial.task, *self.start

    @property
    def start(self) -> tuple[str, int]:
        """The crumpled garment, which all methods and both tasks meet."""
        return self.trial.category, self.trial.state


def episodes(lines: Iterable[Line], picks: int, start: str = "drop") -> list[Episode]:
    """The episodes of at most `picks` picks from such a start state, in the order of the table, each once."""
    grouped: dict[str, dict[int, Line]] = defaultdict(dict)
    for line in lines:
        grouped[line["key"]].setdefault(line["pick"], line)
    found = [_episode(Trial.of(key), [steps[pick] for pick in sorted(steps)]) for key, steps in grouped.items()]
    kept = [one for one in found if (one.trial.picks, one.trial.start) == (picks, start)]
    return sorted(kept, key=lambda one: (one.variant.place, one.trial.key))


def _episode(trial: Trial, steps: Sequence[Line]) -> Episode:
    return Episode(
        trial=trial,
        ni=np.minimum(carried_forward([line["ni"] for line in steps], trial.picks), 1.0),
        seconds=tuple(line["seconds"] for line in steps if line["pick"] > 0),
        gave_up=steps[-1].get("gave_up", ""),
        commit=steps[-1].get("commit", ""),
    )


def by_variant(found: Iterable[Episode]) -> dict[Variant, list[Episode]]:
    """Each variant's episodes, in the order of the table."""
    groups: dict[Variant, list[Episode]] = defaultdict(list)
    for one in found:
        groups[one.variant].append(one)
    return dict(sorted(groups.items(), key=lambda item: item[0].place))


def seconds_per_pick(found: Iterable[Episode]) -> float | None:
    """Median over all picks [s]; None without any."""
    spent = [seconds for one in found for seconds in one.seconds]
    return float(np.median(spent)) if spent else None
