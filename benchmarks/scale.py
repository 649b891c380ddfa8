"""How candidates a second grow with the dynamics replicas: `python -m benchmarks.scale`.

Starts a simulated cell with one replica, then one with two, every replica pinned to a processor of its own, and has the
same candidates planned on the true mesh of a dropped, held-out garment: rolled out by the cloth solver, and by a model
(one that has learnt nothing unless weights are given, it is as fast). Nothing is screened out.
"""

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import tyro
from rich.console import Console
from rich.table import Table

from benchmarks.planning import HELD_OUT_SEED, plan_once, rollout_cpu_s
from medor_wire import endpoints
from medor_wire.launcher import Launcher, heed_signals
from medor_wire.messages import Category, ResetRequest

METHODS = {"physics": "oracle", "learned": "oracle-mesh"}
"""By backend, the method that plans with it on the true mesh."""


@dataclass(frozen=True)
class Options:
    """What to measure."""

    category: Category = "tshirt"
    candidates: int = 200
    replicas: tuple[int, ...] = (1, 2)
    weights: Path | None = None
    """Folder of a trained model."""


@dataclass(frozen=True)
class Speed:
    """Of one backend with some replicas."""

    candidates_per_s: float
    cpu_s: float
    """Of a candidate."""


def main(options: Options) -> None:
    with TemporaryDirectory() as folder:
        weights = options.weights or untrained(Path(folder))
        speeds = {replicas: measured(options, replicas, weights.absolute()) for replicas in options.replicas}
    Console().print(table(speeds))


def untrained(folder: Path) -> Path:
    """Weights that have learnt nothing."""
    subprocess.run([sys.executable, "-m", "medor_dynamics.untrained", "--out", str(folder)], check=True)
    return folder


def measured(options: Options, replicas: int, weights: Path) -> dict[str, Speed]:
    """Speeds of a cell, by backend."""
    environment = {
        "MEDOR_DYNAMICS__REPLICAS": str(replicas),
        "MEDOR_DYNAMICS__THREADS": "1",
        "MEDOR_DYNAMICS__WEIGHTS": str(weights),
    }
    with Launcher("sim", echo=False, environment=environment) as cell:
        cell.wait_ready()
        pinned(cell)
        cell.bus.ask(endpoints.RESET, ResetRequest(category=options.category, garment_seed=HELD_OUT_SEED))
        return {backend: speed(cell, options, method) for backend, method in METHODS.items()}


def pinned(cell: Launcher) -> None:
    """Gives every replica a processor of its own, or a share of one where there are fewer: all threads it has now.

    Threads begun later inherit the processor.
    """
    processors = sorted(os.sched_getaffinity(0))
    replicas = [process.pid for name, process in cell.processes.items() if name.startswith("dynamics")]
    for number, pid in enumerate(pid for pid in replicas if pid):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setaffinity(int(thread.name), {processors[number % len(processors)]})


def speed(cell: Launcher, options: Options, method: str) -> Speed:
    plan_once(cell.bus, options.category, candidates=8, seed=0, method=method)  # what is made once is not measured
    before = rollout_cpu_s(cell)
    plan = plan_once(cell.bus, options.category, options.candidates, seed=1, method=method)
    cpu_s = (rollout_cpu_s(cell) - before) / plan.candidates
    return Speed(plan.candidates / (plan.timings_ms["rollout"] / 1e3), cpu_s)


def table(speeds: Mapping[int, Mapping[str, Speed]]) -> Table:
    """Candidates a second, and how many times as many as with the fewest replicas."""
    found = Table("backend", *(f"{count} replica{'s' * (count > 1)}" for count in speeds), "CPU-ms a candidate")
    fewest = speeds[min(speeds)]
    for backend in METHODS:
        row = [each[backend] for each in speeds.values()]
        rates = [
            f"{it.candidates_per_s:.1f}/s ({it.candidates_per_s / fewest[backend].candidates_per_s:.2f}x)" for it in row
        ]
        found.add_row(backend, *rates, ", ".join(f"{1e3 * it.cpu_s:.0f}" for it in row))
    return found


if __name__ == "__main__":
    heed_signals()
    main(tyro.cli(Options, description=__doc__))
