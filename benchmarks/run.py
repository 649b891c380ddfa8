"""Closed-loop evaluation over the bus: `python -m benchmarks.run --methods oracle visible random --states 2`.

Starts a simulated cell of its own (or uses a running one with `--router`), runs every trial of the protocol that
the results file does not hold yet, appends one JSON line per pick, and prints the table. Kill it and start it again:
it goes on where it stopped.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from benchmarks.protocol import Engine, Trial, trials
from benchmarks.results import Line, Results
from benchmarks.table import markdown
from medor_wire import endpoints
from medor_wire.bus import Bus, join
from medor_wire.config import BusConfig
from medor_wire.errors import MedorError
from medor_wire.launcher import Launcher, heed_signals
from medor_wire.messages import Category, EpisodePick, EpisodeProgress, Executor, Message, StartState, Task

ALL: tuple[Category, ...] = ("trousers", "tshirt", "dress", "skirt", "jumpsuit")


@dataclass(frozen=True)
class Options:
    """What to evaluate."""

    methods: tuple[str, ...] = ("oracle", "visible", "random")
    categories: tuple[Category, ...] = ALL
    tasks: tuple[Task, ...] = ("flatten", "canonicalize")
    states: int = 3
    """Held-out garments with one crumple each, per category."""
    start: StartState = "drop"
    picks: int = 10
    candidates: int = 100
    executor: tuple[Executor, ...] = ("picker",)
    """Who picks: the paper's flying gripper, the Panda arm, or both on the same states."""
    engine: Engine = "xpbd"
    """What moves the cloth in the cell that is started: our solver, or PyBullet's soft body (slow)."""
    softness: float = 1.0
    """How many times as easily as usual the cloth bends, on the table and in the planner's physics alike."""
    out: Path = Path("runs/bench")
    router: str = ""
    """Zenoh endpoint of a running cell; empty starts one."""


@contextmanager
def cell_bus(router: str, environment: dict[str, str], logs: Path) -> Iterator[Bus]:
    """A bus member in a simulated cell, started for the purpose (with its `logs`) when no router is given."""
    if router:
        with join("benchmark", BusConfig(router=router)) as bus:
            yield bus
        return
    with Launcher("sim", environment=environment, echo=False, logs=logs) as cell:
        cell.wait_ready()
        yield cell.bus


def run_trial(bus: Bus, trial: Trial, console: Console) -> list[Line]:
    """The lines of one episode, start state included.

    Raises:
        MedorError: the cell refused or was lost.
    """
    steps: list[tuple[EpisodePick, float]] = []
    began = time.perf_counter()

    def report(message: Message) -> None:
        if isinstance(message, EpisodeProgress) and message.step is not None:
            steps.append((message.step, time.perf_counter()))
            console.print(f"  {trial.key}  pick {message.step.index}  NI {message.step.ni:.3f}", highlight=False)

    bus.ask(endpoints.EPISODE, trial.request(), on_progress=report)
    lines = []
    for step, ended in steps:
        lines.append(
            {
                "key": trial.key,
                "method": trial.label,
                "category": trial.category,
                "task": trial.task,
                "state": trial.state,
                "pick": step.index,
                "ni": step.ni,
                "coverage_m2": step.coverage_m2,
                "no_op": step.no_op,
                "seconds": ended - began,
                "timings_ms": step.timings_ms,
                "last": step is steps[-1][0],
            }
        )
        began = ended
    return lines


def main(options: Options) -> int:
    """Run what is missing; 0 when every trial is in the file."""
    console = Console(stderr=True)
    results = Results(options.out / "picks.jsonl")
    results.keep_finished()
    every = list(
        trials(
            options.methods,
            options.categories,
            options.tasks,
            options.states,
            options.start,
            options.picks,
            options.candidates,
            options.executor,
            options.engine,
            options.softness,
        )
    )
    missing = [trial for trial in every if trial.key not in results.finished()]
    console.print(f"{len(every) - len(missing)} of {len(every)} episodes in {results.path}")
    failed = run_missing(missing, results, options, console) if missing else 0
    keys = {trial.key for trial in every}
    lines = [line for line in results.lines() if line["key"] in keys]
    if lines:
        table = markdown(lines, options.picks)
        (options.out / "table.md").write_text(table + "\n")
        print(table)
    return 1 if failed else 0


def run_missing(missing: list[Trial], results: Results, options: Options, console: Console) -> int:
    """Run trials one after the other; how many failed."""
    failed, began = 0, time.monotonic()
    cell = {"MEDOR_SIM__ENGINE": options.engine}
    cell |= dict.fromkeys(("MEDOR_SIM__SOFTNESS", "MEDOR_DYNAMICS__SOFTNESS"), str(options.softness))
    with cell_bus(options.router, cell, (options.out / "logs").absolute()) as bus:
        for done, trial in enumerate(missing):
            try:
                results.append(run_trial(bus, trial, console))
            except MedorError as error:
                failed += 1
                console.print(f"[red]{trial.key}: {error.code}: {error}[/red]")
            left = (time.monotonic() - began) / (done + 1) * (len(missing) - done - 1)
            console.print(f"{done + 1}/{len(missing)} episodes, about {left / 60:.0f} min left")
    return failed


if __name__ == "__main__":
    heed_signals()
    sys.exit(main(tyro.cli(Options, description=__doc__)))
