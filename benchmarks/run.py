"""Closed-loop evaluation over the bus: `python -m benchmarks.run --methods oracle visible random --states 2`.

Starts a simulated cell of its own (or uses a running one with `--router`), runs every trial of the protocol that
the results file does not hold yet and appends one JSON line per pick. Kill it and start it again: it goes on where it
stopped. Methods without weights are skipped. Then everything in the folder is written up as `table.json`, `table.md`
and `report.html`; with `--report-only` that is all it does.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from benchmarks.closed_loop import ClosedLoop
from benchmarks.findings import Findings
from benchmarks.protocol import Engine, Trial, trials
from benchmarks.provenance import provenance
from benchmarks.published import METHODS
from benchmarks.report import page
from benchmarks.results import Missing, Results
from benchmarks.skips import Skips
from medor_wire.bus import Bus, join
from medor_wire.config import BusConfig
from medor_wire.launcher import Launcher, heed_signals
from medor_wire.messages import Category, Executor, StartState, Task

ALL: tuple[Category, ...] = ("trousers", "tshirt", "dress", "skirt", "jumpsuit")


@dataclass(frozen=True)
class Options:
    """What to evaluate."""

    methods: tuple[str, ...] = METHODS
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
    exhaustive: bool = False
    """Roll every candidate out: no rough model screens them."""
    out: Path = Path("runs/bench")
    router: str = ""
    """Zenoh endpoint of a running cell; empty starts one."""
    report_only: bool = False
    """Run nothing: write up what the folders hold."""
    also: tuple[Path, ...] = ()
    """Other results folders to write up with this one. Where both hold an episode, this one's counts."""

    def trials(self) -> list[Trial]:
        """Everything asked for."""
        what = self.methods, self.categories, self.tasks, self.states, self.start, self.picks, self.candidates
        return list(trials(*what, self.executor, self.engine, self.softness, self.exhaustive))


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


def main(options: Options) -> int:
    """Run what is missing and write it up; 0 when all of it is in the file, but for skipped methods."""
    console = Console(stderr=True)
    failed = 0 if options.report_only else run(options, console)
    write_up(options, console)
    return 1 if failed else 0


def run(options: Options, console: Console) -> int:
    """Runs the trials that the results file lacks; how many failed."""
    results, every = Results(options.out / "picks.jsonl"), options.trials()
    results.keep_finished()
    finished = results.finished()
    missing = [trial for trial in every if trial.key not in finished]
    console.print(f"{len(every) - len(missing)} of {len(every)} episodes in {results.path}", highlight=False)
    if not missing:
        return 0
    skips = Skips(finished)
    cell = {"MEDOR_SIM__ENGINE": options.engine}
    cell |= dict.fromkeys(("MEDOR_SIM__SOFTNESS", "MEDOR_DYNAMICS__SOFTNESS"), str(options.softness))
    with cell_bus(options.router, cell, (options.out / "logs").absolute()) as bus:
        loop = ClosedLoop(
            bus, options.out, lambda line: console.print(line, highlight=False, markup=False, soft_wrap=True)
        )
        reasons = loop.run(missing, results, skips)
    Missing(options.out / "missing.json").keep(reasons)
    return sum(trial.key in reasons and skips.reason(trial) is None for trial in missing)


def write_up(options: Options, console: Console) -> None:
    """Writes the tables and the report of the folders, and prints the tables."""
    findings = Findings.of((options.out, *options.also), options.picks, options.start, provenance())
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "table.json").write_text(findings.as_json())
    (options.out / "table.md").write_text(findings.as_markdown())
    (options.out / "report.html").write_text(page(findings))
    print(findings.as_markdown())
    console.print(f"report: {options.out / 'report.html'}", highlight=False)


if __name__ == "__main__":
    heed_signals()
    sys.exit(main(tyro.cli(Options, description=__doc__)))
