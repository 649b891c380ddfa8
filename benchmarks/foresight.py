"""Does what is foreseen happen? `python -m benchmarks.foresight FOLDER …`, of results of `benchmarks.run`.

Of every pull of `flatten` that a plan chose: how much more the garment should have covered afterwards, by the method's
own model on its own mesh, and how much more it did.
"""

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.results import Line, Results

QUARTERS = 4


def changes(lines: Iterable[Line]) -> dict[str, NDArray[np.float64]]:
    """(N, 2) foreseen and actual change of coverage, as shares of it, of each method's pulls, in their order."""
    found: dict[str, list[tuple[float, float]]] = defaultdict(list)
    before: dict[str, float] = {}
    for line in lines:
        key, coverage = line["key"], line["coverage_m2"]
        pulled = line["pick"] > 0 and not line["no_op"] and line["task"] == "flatten"
        if pulled and line.get("no_op_reward"):  # older results do not tell, and `random` foresees nothing
            foreseen = line["reward"] / line["no_op_reward"] - 1
            found[line["method"]].append((foreseen, coverage / before[key] - 1))
        before[key] = coverage
    return {method: np.array(pairs) for method, pairs in found.items()}


def table(found: dict[str, NDArray[np.float64]]) -> Table:
    """A row for each quarter of a method's pulls, by what was foreseen."""
    out = Table("method", "pulls", "foreseen", "actual", "better than before", "correlation")
    for method, pairs in found.items():
        correlation = np.corrcoef(pairs[:, 0], pairs[:, 1])[0, 1] if len(pairs) > 1 else np.nan
        for number, which in enumerate(np.array_split(pairs[:, 0].argsort(), QUARTERS)):
            if len(which):
                foreseen, actual = pairs[which, 0], pairs[which, 1]
                head = (method, f"{correlation:.2f}") if number == 0 else ("", "")
                means = (f"{foreseen.mean():+.1%}", f"{actual.mean():+.1%}", f"{np.mean(actual > 0):.0%}")
                out.add_row(head[0], str(len(which)), *means, head[1])
    return out


def main(folders: tyro.conf.Positional[tuple[Path, ...]]) -> None:
    """Compare what plans foresaw with what came of them.

    Args:
        folders: with `picks.jsonl`.
    """
    lines = [line for folder in folders for line in Results(folder / "picks.jsonl").lines()]
    Console().print(table(changes(lines)))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
