"""Normalized improvement after 1, 2, 3, 5 and 10 picks: median and quartiles per method, task and category."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.results import Line
from medor_cloth.improvement import carried_forward, quartiles

AT_PICKS = (1, 2, 3, 5, 10)
Group = tuple[str, str, str]
"""Method, task, category (or `all`)."""


def curves(lines: Sequence[Line], picks: int) -> dict[Group, NDArray[np.float64]]:
    """NI after 0..picks picks of every episode, (episodes, picks + 1), by group.

    An episode that ended early keeps its last value.
    """
    episodes: dict[str, list[Line]] = defaultdict(list)
    for line in lines:
        episodes[line["key"]].append(line)
    groups: dict[Group, list[NDArray[np.float64]]] = defaultdict(list)
    for steps in episodes.values():
        by_pick = sorted(steps, key=lambda line: line["pick"])
        filled = carried_forward([line["ni"] for line in by_pick], picks)
        method, task, category = (by_pick[0][name] for name in ("method", "task", "category"))
        groups[method, task, category].append(filled)
        groups[method, task, "all"].append(filled)
    return {group: np.stack(rows) for group, rows in groups.items()}


def markdown(lines: Sequence[Line], picks: int) -> str:
    """The table as Markdown: `median (q25 to q75)` per pick count."""
    at = [p for p in AT_PICKS if p <= picks]
    rows = [
        f"| method | task | category | episodes | {' | '.join(f'NI@{p}' for p in at)} | s/pick |",
        f"|{'---|' * (5 + len(at))}",
    ]
    seconds = _seconds_per_pick(lines)
    for group, values in sorted(curves(lines, picks).items(), key=_order):
        cells = []
        for p in at:
            q25, median, q75 = quartiles(values[:, p])
            cells.append(f"{median:.2f} ({q25:.2f} to {q75:.2f})")
        rows.append(f"| {' | '.join(group)} | {len(values)} | {' | '.join(cells)} | {seconds[group]:.1f} |")
    return "\n".join(rows)


def _order(item: tuple[Group, NDArray[np.float64]]) -> tuple[str, bool, str, str]:
    (method, task, category), _ = item
    return task, category == "all", category, method


def _seconds_per_pick(lines: Sequence[Line]) -> dict[Group, float]:
    spent: dict[Group, list[float]] = defaultdict(list)
    for line in lines:
        if line["pick"] > 0:
            spent[line["method"], line["task"], line["category"]].append(line["seconds"])
            spent[line["method"], line["task"], "all"].append(line["seconds"])
    return defaultdict(float, {group: float(np.median(values)) for group, values in spent.items()})
