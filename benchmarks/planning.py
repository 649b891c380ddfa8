"""How long a plan takes and what it leaves behind: `python -m benchmarks.planning`.

Starts a simulated cell with as many dynamics replicas as asked for (one processor each), drops a held-out garment
and plans for it with the true mesh. Run it with `--replicas 1` and `--replicas 2` to see how planning scales.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from medor_wire import endpoints
from medor_wire.bus import Bus
from medor_wire.launcher import Launcher
from medor_wire.messages import Category, Plan, PlanRequest, ResetRequest

PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
HELD_OUT_SEED = 800_001


@dataclass(frozen=True)
class Options:
    """What to measure."""

    category: Category = "tshirt"
    candidates: int = 500
    replicas: int = 2
    plans: int = 1
    """How many in a row; with 20 of 50 candidates one sees whether memory stays flat."""


def main(options: Options) -> None:
    console = Console()
    threads = {"MEDOR_DYNAMICS__REPLICAS": str(options.replicas), "MEDOR_DYNAMICS__THREADS": "1"}
    with Launcher("sim", echo=False, environment=threads) as cell:
        cell.wait_ready()
        reset = ResetRequest(category=options.category, garment_seed=HELD_OUT_SEED)
        cell.bus.ask(endpoints.RESET, reset)
        plan_once(cell.bus, options.category, candidates=8, seed=0)  # what is made once per garment is not measured
        for number in range(options.plans):
            before = rollout_cpu_s(cell)
            plan = plan_once(cell.bus, options.category, options.candidates, seed=number + 1)
            spent = rollout_cpu_s(cell) - before
            console.print(line(plan, options, spent), memory_line(cell), soft_wrap=True)


def plan_once(bus: Bus, category: Category, candidates: int, seed: int, method: str = "oracle") -> Plan:
    request = PlanRequest(category=category, method=method, candidates=candidates, seed=seed, exhaustive=True)
    return bus.ask(endpoints.PLAN, request)


def line(plan: Plan, options: Options, cpu_s: float) -> str:
    seconds = plan.timings_ms["total"] / 1e3
    return (
        f"{plan.category}, {len(plan.mesh.vertices)} vertices, {plan.candidates} candidates, "
        f"{options.replicas} replicas: {seconds:.1f} s, {1e3 * cpu_s / plan.candidates:.0f} CPU-ms a candidate, "
        f"coverage {plan.no_op_reward * 1e4:.0f} -> {plan.reward * 1e4:.0f} cm2;"
    )


def memory_line(cell: Launcher) -> str:
    """Resident memory of the processes that plan [MB]."""
    planning = {name: process.pid for name, process in cell.processes.items() if name.startswith(("dyn", "plan"))}
    return ", ".join(f"{name} {resident_mb(pid):.0f} MB" for name, pid in planning.items() if pid)


def rollout_cpu_s(cell: Launcher) -> float:
    """Processor time of all dynamics replicas so far [s]; unlike the clock it does not see what else runs here."""
    pids = [process.pid for name, process in cell.processes.items() if name.startswith("dynamics")]
    stats = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids if pid]
    return sum(int(stat[11]) + int(stat[12]) for stat in stats) / os.sysconf("SC_CLK_TCK")


def resident_mb(pid: int) -> float:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_BYTES / 2**20


if __name__ == "__main__":
    main(tyro.cli(Options))
