"""The tables as Markdown: the ablation, and NI after 1, 2, 3, 5 and 10 picks by method, task and category."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.ablation import CELLS, Row
from benchmarks.episodes import Episode, Variant, seconds_per_pick
from benchmarks.published import ABLATION, CATEGORIES, TASKS, by_category
from benchmarks.published import AT_PICKS as PUBLISHED_AT
from medor_cloth.improvement import quartiles

AT_PICKS = (1, 2, 3, 5, 10)


@dataclass(frozen=True)
class Group:
    """Episodes of one variant, task and category (or `all`)."""

    variant: Variant
    task: str
    category: str
    members: tuple[Episode, ...]

    @property
    def curves(self) -> NDArray[np.float64]:
        """NI after 0, 1, … picks, (episodes, picks + 1)."""
        return np.stack([one.ni for one in self.members])

    @property
    def mean(self) -> NDArray[np.float64]:
        """NI after 0, 1, … picks; the mean over categories of the mean over episodes."""
        categories: dict[str, list[NDArray[np.float64]]] = defaultdict(list)
        for one in self.members:
            categories[one.trial.category].append(one.ni)
        return np.mean([np.mean(curves, axis=0) for curves in categories.values()], axis=0)

    def quartiles(self, pick: int) -> tuple[float, float, float]:
        """Of NI after so many picks."""
        low, median, high = quartiles(self.curves[:, pick]).tolist()
        return low, median, high

    @property
    def published(self) -> tuple[float, ...] | None:
        """The paper's figures after 3, 5 and 10 picks."""
        return by_category(self.variant.label, self.task, self.category)


def groups(found: Sequence[Episode]) -> list[Group]:
    """By task and category, `all` last, then by variant in the order of the table."""
    sorted_in: dict[tuple[str, str, Variant], list[Episode]] = defaultdict(list)
    for one in found:
        for category in (one.trial.category, "all"):
            sorted_in[one.trial.task, category, one.variant].append(one)
    order = (*CATEGORIES, "all")
    keys = sorted(sorted_in, key=lambda key: (TASKS.index(key[0]), order.index(key[1]), key[2].place))
    return [
        Group(variant, task, category, tuple(sorted_in[task, category, variant])) for task, category, variant in keys
    ]


Cells = Sequence[Sequence[str]]
"""Rows of a table, its head first."""


def ablation_cells(rows: Sequence[Row]) -> Cells:
    """The ablation table."""
    head = ["method", "candidates", "NI (95 %)", "of medians", "of `oracle` (paper's)", "paper", "paper's row"]
    return [head + ["cells", "garments", "episodes", "gave up", "s/pick"], *map(_ablation_row, rows)]


def _ablation_row(row: Row) -> list[str]:
    between = f" ({row.interval[0]:.3f} to {row.interval[1]:.3f})" if row.interval else ""
    paper = row.published
    return [
        row.variant.label,
        str(row.variant.candidates),
        f"{row.ni:.3f}{between}",
        f"{row.ni_of_medians:.3f}",
        ("–" if row.of_oracle is None else f"{row.of_oracle:.2f}")
        + (f" ({paper.ni / ABLATION['oracle'].ni:.2f})" if paper else ""),
        f"{paper.ni:.3f} ± {paper.spread:.3f}" if paper else "–",
        paper.row if paper else "–",
        f"{row.cells} of {CELLS}",
        str(row.starts),
        str(row.episodes),
        str(row.gave_up),
        _seconds(row.seconds_per_pick),
    ]


def category_cells(found: Sequence[Group], picks: int) -> Cells:
    """The table by category: `median (q25 to q75)` per pick count."""
    at = [pick for pick in AT_PICKS if pick <= picks]
    head = ["method", "candidates", "task", "category", "episodes", *(f"NI@{pick}" for pick in at)]
    return [head + [f"paper NI@{', '.join(map(str, PUBLISHED_AT))}", "s/pick"], *(_group_row(one, at) for one in found)]


def _group_row(group: Group, at: Sequence[int]) -> list[str]:
    quarters = [group.quartiles(pick) for pick in at]
    return [
        group.variant.label,
        str(group.variant.candidates),
        group.task,
        group.category,
        str(len(group.members)),
        *(f"{median:.2f} ({low:.2f} to {high:.2f})" for low, median, high in quarters),
        ", ".join(f"{ni:.2f}" for ni in group.published) if group.published else "–",
        _seconds(seconds_per_pick(group.members)),
    ]


def _seconds(seconds: float | None) -> str:
    return "–" if seconds is None else f"{seconds:.1f}"


def markdown(cells: Cells) -> str:
    """A table in Markdown."""
    head, *rows = (f"| {' | '.join(row)} |" for row in cells)
    return "\n".join([head, f"|{'---|' * len(cells[0])}", *rows])
