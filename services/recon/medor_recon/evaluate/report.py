"""Records of observations as statistics and as a table."""

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import numpy as np

COLUMNS = {
    "canonical": ("canonical", "{:.3f}"),
    "canonical_plain": ("plain", "{:.3f}"),
    "side_right": ("side right", "{:.0%}"),
    "vertex": ("vertex [cm]", "{:.2f}"),
    "visible": ("visible [cm]", "{:.2f}"),
    "hidden": ("hidden [cm]", "{:.2f}"),
    "view": ("view [mm]", "{:.2f}"),
    "chamfer": ("chamfer [cm]", "{:.2f}"),
    "coverage_size": ("coverage", "{:.1%}"),
    "strain_95": ("strain 95 %", "{:+.0%}"),
    "crossings": ("crossings", "{:.2f}"),
    "seconds_canonicalize": ("canonicalise [s]", "{:.2f}"),
    "seconds_complete": ("complete [s]", "{:.2f}"),
    "seconds_refine": ("finetune [s]", "{:.2f}"),
}
"""Measures shown, their headings and formats."""
IN_MM = ("view",)
BEFORE = ", before"
"""What is added to the name of a method for its mesh before finetuning."""


def summarize(records: Iterable[dict[str, Any]]) -> dict[str, dict[str, dict[str, Any]]]:
    """Statistics by category, of `all` where there are several, by method, and of what the methods finetune.

    Methods that finetune the same meshes share one entry for these, under the name of the first of them.

    Returns:
        For each: `count`, `failed`, and mean, median and quartiles of every measure.
    """
    records = list(records)
    together = {"all"} if len({record["category"] for record in records}) > 1 else set()
    groups: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for record in records:
        for category in {record["category"], *together}:
            groups[category, record["method"]].append(record)
    found: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)
    for (category, method), members in groups.items():
        done = [member for member in members if "failed" not in member]
        failed = len(members) - len(done)
        before, after = (_statistics([one[when] for one in done], failed) for when in ("before", "after"))
        if done and before not in found[category].values():
            found[category][method + BEFORE] = before
        found[category][method] = after
    return dict(found)


def markdown(summary: dict[str, dict[str, dict[str, Any]]]) -> str:
    """Tables of means, one for each category."""
    return "\n".join(_table(category, rows) for category, rows in sorted(summary.items()))


def _statistics(measures: list[dict[str, float]], failed: int) -> dict[str, Any]:
    found: dict[str, Any] = {"count": len(measures), "failed": failed}
    for name in measures[0] if measures else ():
        values = np.array([one[name] for one in measures], float)
        values = values[np.isfinite(values)]
        if len(values):
            low, middle, high = np.percentile(values, (25, 50, 75))
            found[name] = {"mean": float(values.mean()), "q25": low, "median": middle, "q75": high}
    return found


def _table(category: str, rows: dict[str, dict[str, Any]]) -> str:
    shown = [name for name in COLUMNS if any(name in row for row in rows.values())]
    heads = ["method", "views", "failed", *(COLUMNS[name][0] for name in shown)]
    lines = [f"### {category}", "", "| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for method, row in rows.items():
        cells = [_cell(name, row) for name in shown]
        lines.append("| " + " | ".join([method, str(row["count"]), str(row["failed"]), *cells]) + " |")
    return "\n".join([*lines, ""])


def _cell(name: str, row: dict[str, Any]) -> str:
    if name not in row:
        return ""
    return COLUMNS[name][1].format(row[name]["mean"] * (10 if name in IN_MM else 1))
