"""Everything a report of one or several results folders says."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks import pictures
from benchmarks.ablation import Row, ablation
from benchmarks.episodes import Episode, episodes, seconds_per_pick
from benchmarks.protocol import Trial
from benchmarks.published import AT_PICKS as PUBLISHED_AT
from benchmarks.published import VCD
from benchmarks.results import Missing, Results
from benchmarks.table import AT_PICKS, Group, ablation_cells, category_cells, groups, markdown

NOTES = (
    "NI, normalized improvement: 0 as found, 1 at the goal. An episode that ended early keeps its last value; values"
    " are clipped at 1.",
    "By method: means over picks 3, 5 and 10, over episodes, then over tasks and categories, each counting the same."
    " The interval is a bootstrap over crumpled garments. `of medians`: with medians over episodes in place of means,"
    " as the paper presumably has it. `of oracle`: share of what `oracle` reaches on the same tasks and garments."
    " Cells are pairs of task and category.",
    "The paper's figures are of its own simulator and garments, with 500 candidates a pick, and stand for methods with"
    " learned dynamics, but for its two rows with GT dynamics. A method named `+physics` plans with our cloth solver:"
    f" only `medor+physics` has a counterpart. `visible` sees what {VCD.row} sees ({VCD.ni:.3f} ± {VCD.spread:.3f}) and"
    " plans with the solver: near to it, not the same. Rows that lack cells cannot be held against the paper.",
    "By category: median (quartiles). The paper's columns are headed 1, 2, 3 there; by their means they are picks 3,"
    " 5, 10. `all` is the median over all episodes, the paper's the mean over its categories.",
)


@dataclass(frozen=True)
class Findings:
    """Episodes, what they come to, and where that comes from."""

    made: dict[str, str]
    """Date, commit, machine and command of this report."""
    picks: int
    found: tuple[Episode, ...]
    missing: dict[str, str]
    """Why trials that were asked for are not among them, by key."""
    folders: tuple[Path, ...]

    @classmethod
    def of(cls, folders: Sequence[Path], picks: int, start: str, made: dict[str, str]) -> "Findings":
        """What results folders hold of such episodes; of two with one key that of the earlier folder counts."""
        parts = [episodes(Results(folder / "picks.jsonl").lines(), picks, start) for folder in folders]
        by_key = {one.trial.key: one for part in reversed(parts) for one in part}
        found = tuple(sorted(by_key.values(), key=lambda one: (one.variant.place, one.trial.key)))
        reasons = [Missing(folder / "missing.json").reasons() for folder in folders]
        missing = {key: reason for one in reasons for key, reason in one.items() if key not in by_key}
        return cls(made, picks, found, missing, tuple(folders))

    @cached_property
    def rows(self) -> list[Row]:
        return ablation(self.found)

    @cached_property
    def groups(self) -> list[Group]:
        return groups(self.found)

    @cached_property
    def facts(self) -> dict[str, str]:
        """Where the figures come from."""
        commits = ", ".join(sorted({one.commit for one in self.found if one.commit}))
        return {**self.made, **({"episodes run at": commits} if commits else {}), "episodes": str(len(self.found))}

    @cached_property
    def refusals(self) -> dict[str, str]:
        """What is missing, by method: how many episodes, and why the first of them."""
        by_method: dict[str, list[str]] = {}
        for key, reason in self.missing.items():
            by_method.setdefault(Trial.of(key).label, []).append(reason)
        return {label: f"{len(all_)} episodes, {all_[0]}" for label, all_ in by_method.items()}

    def picture(self, group: Group) -> tuple[Episode, Path] | None:
        """The first episode of a group of which there is a picture."""
        for one in group.members:
            for folder in self.folders:
                if (path := pictures.path(folder, one.trial.key)).exists():
                    return one, path
        return None

    def as_markdown(self) -> str:
        """Both tables, what is missing and how to read them."""
        facts = [f"- {name}: {f'`{value}`' if name == 'command' else value}" for name, value in self.facts.items()]
        refusals = [f"- `{label}`: {reason}" for label, reason in self.refusals.items()]
        parts = [
            "\n".join(facts),
            "## By method",
            markdown(ablation_cells(self.rows)),
            "## By category",
            markdown(category_cells(self.groups, self.picks)),
            *(["## Missing", "\n".join(refusals)] if refusals else []),
            "## How to read this",
            "\n".join(f"- {note}" for note in NOTES),
        ]
        return "\n\n".join(parts) + "\n"

    def as_json(self) -> str:
        """All figures, unrounded."""
        content = {
            "made": self.facts,
            "picks": self.picks,
            "ablation": [_row(row) for row in self.rows],
            "by_category": [_group(group, self.picks) for group in self.groups],
            "missing": self.missing,
        }
        return json.dumps(content, indent=1) + "\n"


def _row(row: Row) -> dict[str, Any]:
    fields = asdict(row) | row.variant._asdict() | {"complete": row.complete}
    return {name: value for name, value in fields.items() if name != "variant"}


def _group(group: Group, picks: int) -> dict[str, Any]:
    at = [pick for pick in AT_PICKS if pick <= picks]
    return {
        **group.variant._asdict(),
        "task": group.task,
        "category": group.category,
        "episodes": len(group.members),
        "seconds_per_pick": seconds_per_pick(group.members),
        "mean_ni": group.mean.tolist(),
        "ni": {pick: dict(zip(("q25", "median", "q75"), group.quartiles(pick), strict=True)) for pick in at},
        "published": dict(zip(PUBLISHED_AT, group.published, strict=True)) if group.published else None,
    }
