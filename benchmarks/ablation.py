"""The ablation table: one figure for each method, with an interval, beside the paper's."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.episodes import Episode, Variant, by_variant, seconds_per_pick
from benchmarks.published import ABLATION, AT_PICKS, CATEGORIES, TASKS, Published

CELLS = len(TASKS) * len(CATEGORIES)
RESAMPLES = 2000
SEED = 0


@dataclass(frozen=True)
class Row:
    """A method's NI over picks 3, 5 and 10, both tasks and all categories; every task and category counts the same."""

    variant: Variant
    ni: float
    """Mean over tasks and categories of the mean over episodes and picks."""
    interval: tuple[float, float] | None
    """95 %, by bootstrap over crumpled garments; None from a single one."""
    ni_of_medians: float
    """The same of medians instead of means over episodes, as the paper presumably has it."""
    of_oracle: float | None
    """Share of what `oracle` reaches on the same episodes."""
    cells: int
    """Pairs of task and category with episodes."""
    starts: int
    episodes: int
    gave_up: int
    """Episodes that the method could not go on with; they keep the NI reached."""
    seconds_per_pick: float | None
    published: Published | None

    @property
    def complete(self) -> bool:
        """Whether all tasks and categories are in it, as in the paper's figure."""
        return self.cells == CELLS


def ablation(found: Sequence[Episode]) -> list[Row]:
    """A row for each variant, in the order of the table."""
    groups = by_variant(found)
    oracles = [members for variant, members in groups.items() if variant.label == "oracle"]
    return [_row(variant, members, oracles) for variant, members in groups.items()]


def _row(variant: Variant, members: Sequence[Episode], oracles: Sequence[Sequence[Episode]]) -> Row:
    return Row(
        variant=variant,
        ni=over_cells(members, np.mean),
        interval=interval(members),
        ni_of_medians=over_cells(members, np.median),
        of_oracle=share_of(members, oracles),
        cells=len({one.cell for one in members}),
        starts=len({one.start for one in members}),
        episodes=len(members),
        gave_up=sum(bool(one.gave_up) for one in members),
        seconds_per_pick=seconds_per_pick(members),
        published=ABLATION.get(variant.label),
    )


def share_of(members: Sequence[Episode], oracles: Sequence[Sequence[Episode]]) -> float | None:
    """NI as a share of an oracle's, both on the tasks and garments that both met; None without any.

    Of several oracles the one that met the most of them counts, then the one with the most candidates.
    """
    asked = {one.question for one in members}
    shared = [[one for one in oracle if one.question in asked] for oracle in oracles]
    met = max(shared, key=lambda oracle: (len(oracle), *(one.trial.candidates for one in oracle[:1])), default=[])
    if not met:
        return None
    questions = {one.question for one in met}
    return over_cells([one for one in members if one.question in questions], np.mean) / over_cells(met, np.mean)


def at_picks(one: Episode) -> NDArray[np.float64]:
    """NI after those of the paper's picks that the episode could have made."""
    return one.ni[[pick for pick in AT_PICKS if pick < len(one.ni)] or [-1]]


def over_cells(members: Iterable[Episode], statistic: Callable[..., Any]) -> float:
    """Mean over tasks, categories and picks of a statistic over episodes."""
    cells: dict[tuple[str, str], list[NDArray[np.float64]]] = {}
    for one in members:
        cells.setdefault(one.cell, []).append(at_picks(one))
    return float(np.mean([statistic(np.array(values), axis=0) for values in cells.values()]))


def interval(members: Sequence[Episode]) -> tuple[float, float] | None:
    """Where 95 % of the means lie when the crumpled garments are drawn anew.

    A garment is drawn with all of its tasks, which are not independent. Garments of all categories are drawn
    together, so that the interval says something even of one garment a category; it errs on the wide side.
    """
    values = np.array([at_picks(one).mean() for one in members])
    starts, cells = _numbered([one.start for one in members]), _numbered([one.cell for one in members])
    n_starts = starts.max() + 1
    if n_starts == 1:
        return None
    draws = np.random.default_rng(SEED).multinomial(n_starts, np.full(n_starts, 1 / n_starts), RESAMPLES)
    times = draws[:, starts]
    belongs = cells[:, None] == np.arange(cells.max() + 1)
    counts = times @ belongs
    means = np.divide((times * values) @ belongs, counts, out=np.full(counts.shape, np.nan), where=counts > 0)
    low, high = np.quantile(np.nanmean(means, axis=1), (0.025, 0.975))
    return float(low), float(high)


def _numbered(names: Sequence[Hashable]) -> NDArray[np.int64]:
    """The number of each name among the different ones."""
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([numbers[name] for name in names])
