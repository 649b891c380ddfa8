"""How fast learned rollouts are: `python -m benchmarks.dynamics`.

Runs the dynamics service's own measurement for each preset: the candidates of one decision in batches, and some of
them one graph at a time as in the paper, in the same process.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import tyro
from rich.console import Console
from rich.table import Table

COMMAND = (sys.executable, "-m", "medor_dynamics.bench")


@dataclass(frozen=True)
class Options:
    """What to measure."""

    presets: tuple[str, ...] = ("cpu", "paper")
    candidates: int = 500
    """Of one decision. The `paper` preset is timed on a tenth of them."""
    threads: int = 2
    category: str = "trousers"
    plain: int = 4
    """Candidates rolled out one graph at a time."""


def main(options: Options) -> None:
    table = Table("preset", "nodes", "edges", "precision", f"{options.candidates} candidates", "CPU", "one by one", "")
    for preset in options.presets:
        found = measured(preset, options)
        for precision in [name for name in ("float32", "bfloat16") if name in found]:
            table.add_row(*row(preset, precision, found, options.candidates))
    Console().print(table)


def measured(preset: str, options: Options) -> dict[str, Any]:
    count = options.candidates // 10 if preset == "paper" else options.candidates
    asked = {"preset": preset, "candidates": count, "threads": options.threads, "category": options.category}
    arguments = [
        word for name, value in (asked | {"plain": options.plain}).items() for word in (f"--{name}", str(value))
    ]
    return json.loads(subprocess.run([*COMMAND, *arguments], stdout=subprocess.PIPE, check=True).stdout)


def row(preset: str, precision: str, found: dict[str, Any], candidates: int) -> list[str]:
    share = candidates / found["candidates"]
    ours, plain = found[precision], found["plain_cpu_s_a_candidate"] * candidates
    return [
        preset,
        str(found["nodes"]),
        str(found["edges"]),
        precision,
        f"{ours['wall_s'] * share:.1f} s",
        f"{ours['cpu_s'] * share:.1f} s",
        f"{plain:.0f} s",
        f"{plain / (ours['cpu_s'] * share):.1f} times faster",
    ]


if __name__ == "__main__":
    main(tyro.cli(Options))
