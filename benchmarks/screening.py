"""What screening costs and saves: `python -m benchmarks.screening`.

Starts a simulated cell and decides again and again on held-out garments (others than those of the closed loop): every
candidate is rolled out by the method's own model and rated by the screen. From this follows what would have been chosen
with any share of survivors, and as much worse as that is: by the model, and by the cloth solver on the true garment.
Beside it stand as many candidates drawn at random, which is what planning with fewer candidates comes to.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.decision import NOTHING, Decision, chosen, survivors
from medor_wire import endpoints
from medor_wire.bus import Bus
from medor_wire.errors import BadRequest
from medor_wire.launcher import Launcher, heed_signals
from medor_wire.messages import (
    DEFAULT_METHOD,
    Category,
    ClothMesh,
    Empty,
    ExecuteRequest,
    FlattenRequest,
    Plan,
    PlanRequest,
    ResetRequest,
    Reward,
    RolloutRequest,
    Rollouts,
    Task,
)

HELD_OUT_SEED = 800_500
ALL: tuple[Category, ...] = ("trousers", "tshirt", "dress", "skirt", "jumpsuit")
ROUNDS = 2000
"""Of the bootstrap."""


@dataclass(frozen=True)
class Options:
    """What to measure."""

    method: str = DEFAULT_METHOD
    keep: tuple[float, ...] = (0.05, 0.1, 0.15, 0.2, 0.3, 0.5)
    """Shares of survivors."""
    candidates: int = 500
    states: int = 5
    """Garments with one drop each, per category."""
    picks: int = 2
    """Decisions in a row on each; between them the exhaustive choice is carried out."""
    categories: tuple[Category, ...] = ALL
    tasks: tuple[Task, ...] = ("flatten", "canonicalize")
    replicas: int = 2
    """Of one thread each."""
    weights: Path | None = None
    """Folder of the learned model; else the one that is served by default."""


def main(options: Options) -> None:
    console = Console()
    environment = {"MEDOR_DYNAMICS__REPLICAS": str(options.replicas), "MEDOR_DYNAMICS__THREADS": "1"}
    if options.weights:
        environment["MEDOR_DYNAMICS__WEIGHTS"] = str(options.weights.absolute())
    with Launcher("sim", echo=False, environment=environment) as cell:
        cell.wait_ready()
        found: list[Decision] = []
        try:
            for name, decision in decisions(cell.bus, options):
                found.append(decision)
                console.print(f"{len(found)} {name}: {decision.exhaustive_s:.1f} s exhaustive", highlight=False)
            console.print(planned(cell.bus, options), soft_wrap=True)
        except BadRequest as refused:
            raise SystemExit(f"{refused}") from refused
        finally:  # Ctrl-C leaves what there is
            if found:
                console.print(table(found, options.keep))


def decisions(bus: Bus, options: Options) -> Iterator[tuple[str, Decision]]:
    rng = np.random.default_rng(0)
    for state in range(options.states):
        for category in options.categories:
            reset(bus, category, state)
            for pick in range(options.picks):
                plans = [exhaustive(bus, options, category, task, seed=pick) for task in options.tasks]
                for plan in plans:
                    screened = bus.ask(endpoints.PLAN, request(options, category, plan.task, seed=pick))
                    one = decided(bus, options, plan, screened, rng)
                    yield f"{category} {state}, pick {pick + 1}, {plan.task}", one
                bus.ask(endpoints.EXECUTE, ExecuteRequest(plan_id=plans[0].plan_id))


def reset(bus: Bus, category: Category, state: int) -> None:
    bus.ask(endpoints.RESET, ResetRequest(category=category, garment_seed=HELD_OUT_SEED + state, seed=state))


def request(options: Options, category: Category, task: Task, seed: int) -> PlanRequest:
    return PlanRequest(category=category, task=task, method=options.method, candidates=options.candidates, seed=seed)


def exhaustive(bus: Bus, options: Options, category: Category, task: Task, seed: int) -> Plan:
    """A plan that tells what it thinks of every candidate."""
    asked = request(options, category, task, seed)
    return bus.ask(endpoints.PLAN, asked.model_copy(update={"exhaustive": True, "report": options.candidates}))


def decided(bus: Bus, options: Options, plan: Plan, screened: Plan, rng: np.random.Generator) -> Decision:
    """From a plan of all candidates and one, of the same, as the planner screens them."""
    rated = rolled_out(bus, plan.mesh, plan.task, plan.top_picks, plan.top_places, "coarse")
    chance = rng.random(len(rated.rewards))
    every = {
        chosen(plan.top_rewards, rating, plan.no_op_reward, keep)
        for rating in (rated.rewards, chance)
        for keep in (*options.keep, 1.0)
    }
    planned = place_of(screened, plan)
    return Decision(
        model=plan.top_rewards,
        screen=rated.rewards,
        chance=chance,
        nothing=plan.no_op_reward,
        true=true_rewards(bus, plan, sorted(every | {planned})),
        planned=planned,
        exhaustive_s=seconds(plan),
        screen_s=rated.seconds / options.replicas,
        planned_s=seconds(screened),
    )


def seconds(plan: Plan) -> float:
    """Of everything that foresees and rates [s]."""
    return sum(plan.timings_ms.get(stage, 0.0) for stage in ("screen", "rollout", "judge")) / 1e3


def place_of(screened: Plan, plan: Plan) -> int:
    """Which of a plan's candidates another one chose."""
    if screened.no_op:
        return NOTHING
    apart = np.abs(plan.top_picks - screened.pick).sum(axis=1) + np.abs(plan.top_places - screened.place).sum(axis=1)
    return int(apart.argmin())


def true_rewards(bus: Bus, plan: Plan, candidates: Sequence[int]) -> dict[int, float]:
    """What the cloth solver makes of candidates on the true garment."""
    mesh = bus.ask(endpoints.TRUTH, Empty()).mesh
    nowhere = mesh.vertices[:1] + np.array([0, 0, 1], np.float32)
    which = list(candidates)
    picks, places = (np.concatenate([ends, nowhere])[which] for ends in (plan.top_picks, plan.top_places))
    rolled = rolled_out(bus, mesh, plan.task, picks, places, "physics")
    return dict(zip(which, rolled.rewards.tolist(), strict=True))


def rolled_out(
    bus: Bus, mesh: ClothMesh, task: Task, picks: NDArray[np.float32], places: NDArray[np.float32], backend: str
) -> Rollouts:
    asked = RolloutRequest(mesh=mesh, picks=picks, places=places, reward=reward(bus, task, mesh), backend=backend)
    return bus.ask(endpoints.ROLLOUT, asked)


def reward(bus: Bus, task: Task, mesh: ClothMesh) -> Reward:
    """Coverage, or closeness to the mesh's own goals."""
    if task == "flatten":
        return Reward(task=task)
    if mesh.canonical is None:
        raise SystemExit("expected a method whose mesh has a canonical pose")
    asked = FlattenRequest(category=mesh.category, canonical=mesh.canonical, faces=mesh.faces, panel_uv=mesh.panel_uv)
    return Reward(task=task, goals=bus.ask(endpoints.FLATTEN, asked).goals)


def table(found: Sequence[Decision], shares: Sequence[float]) -> Table:
    title = f"{len(found)} decisions among {len(found[0].model)} candidates; reward given away, with 95 % intervals"
    out = Table("chosen by", "survivors", "seconds", "same choice", "by the model", "by the cloth solver", title=title)
    for keep in shares:
        count, spent = survivors(len(found[0].model), keep), np.mean([it.seconds(keep) for it in found])
        for name, ratings in (("screen", [it.screen for it in found]), ("chance", [it.chance for it in found])):
            losses = np.array([it.loss(rating, keep) for it, rating in zip(found, ratings, strict=True)])
            same = np.mean(losses[:, 0] == 0)
            time = f"{spent:.1f}" if name == "screen" else ""
            out.add_row(name, str(count), time, f"{same:.0%}", *(interval(column) for column in losses.T))
    losses = np.array([it.loss_of(it.planned) for it in found])
    same, time = np.mean(losses[:, 0] == 0), f"{np.mean([it.planned_s for it in found]):.1f}"
    out.add_row("planner", "as set", time, f"{same:.0%}", *(interval(column) for column in losses.T))
    out.add_row("all", str(len(found[0].model)), f"{np.mean([it.exhaustive_s for it in found]):.1f}", "", "", "")
    return out


def interval(values: NDArray[np.float64]) -> str:
    """Mean and its bootstrap interval, per cent."""
    drawn = np.random.default_rng(0).integers(len(values), size=(ROUNDS, len(values)))
    low, high = np.percentile(values[drawn].mean(axis=1), (2.5, 97.5))
    return f"{100 * values.mean():.2f} % ({100 * low:.2f} to {100 * high:.2f})"


def planned(bus: Bus, options: Options) -> str:
    """One plan as the planner makes it, screening as it is set."""
    reset(bus, options.categories[0], 0)
    plan = bus.ask(endpoints.PLAN, request(options, options.categories[0], options.tasks[0], seed=0))
    times = ", ".join(f"{stage} {ms / 1e3:.1f} s" for stage, ms in plan.timings_ms.items())
    return f"a plan for {plan.category} as it is made, {plan.survivors} of {plan.candidates} rolled out: {times}"


if __name__ == "__main__":
    heed_signals()
    main(tyro.cli(Options, description=__doc__))
