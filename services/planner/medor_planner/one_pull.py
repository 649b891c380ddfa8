"""How well each method foresees a single pull: `python -m medor_planner.one_pull --methods visible medor`.

Starts a simulated cell and drops held-out garments (others than those of the closed loop). The cloth solver rolls some
candidates out on the true mesh: that is what they are worth. Then every method rates the same candidates on the mesh it
makes of the view, and its choice is judged by that worth. Cheaper than episodes, and fairer: all methods meet the same
state and the same candidates. Kill it and start it again: it goes on.
"""

import json
import sys
import threading
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.stats import rankdata

from medor_planner.choice import no_op
from medor_planner.goals import Goals
from medor_planner.judge.hearing import Hearing
from medor_planner.methods import METHODS, Method
from medor_planner.sampling import Candidates, Scene
from medor_planner.shooting import Shooting
from medor_planner.watching import Stages
from medor_wire import endpoints
from medor_wire.bus import Bus, Call
from medor_wire.errors import BadRequest, MedorError
from medor_wire.launcher import Launcher, heed_signals
from medor_wire.messages import (
    Category,
    ClothMesh,
    DepthView,
    Empty,
    EpisodeRequest,
    PlanRequest,
    ReconstructRequest,
    ResetRequest,
    Reward,
    RolloutRequest,
    StartState,
    Task,
)

HELD_OUT_SEED = 800_700
ALL: tuple[Category, ...] = ("trousers", "tshirt", "dress", "skirt", "jumpsuit")


@dataclass(frozen=True)
class Options:
    """What to measure."""

    methods: tuple[str, ...] = (
        "medor+judge",
        "visible",
        "medor",
        "isometric",
        "medor+physics",
        "isometric+physics",
        "oracle-mesh",
    )
    categories: tuple[Category, ...] = ALL
    tasks: tuple[Task, ...] = ("flatten",)
    states: int = 4
    """Garments with one crumple each, per category."""
    start: StartState = "drop"
    unfolded: int = 0
    """Pulls by the default method, for the task, before the one that is measured: late ones are harder to foresee."""
    candidates: int = 60
    out: Path = Path("runs/one-pull")


@dataclass(frozen=True)
class Foresight:
    """One method's choice among the candidates of one state.

    Attributes:
        gain: normalized improvement by the candidate it chose; 0 when it chose none.
        best: by the best candidate.
        chance: by a candidate drawn at random, on average.
        rank: Spearman correlation of its rewards with the true ones; 0 where either are all the same.
        unfolded: pulls before this one.
    """

    method: str
    category: Category
    task: Task
    state: int
    gain: float
    best: float
    chance: float
    rank: float
    unfolded: int = 0


@dataclass(frozen=True, eq=False)
class Worth:
    """Candidates of one state and what they are worth.

    Attributes:
        gains: (K,) normalized improvement by each.
    """

    candidates: Candidates
    gains: NDArray[np.float64]

    def judge(self, method: str, category: Category, task: Task, state: int, rewards: NDArray) -> Foresight:
        """A method's rewards (K + 1,), the first of them for doing nothing."""
        best = int(rewards[1:].argmax())
        gain = self.gains[best] if rewards[1 + best] > rewards[0] else 0.0
        differ = np.ptp(rewards[1:]) > 0 and np.ptp(self.gains) > 0
        rank = np.corrcoef(rankdata(rewards[1:]), rankdata(self.gains))[0, 1] if differ else 0.0
        return Foresight(
            method, category, task, state, float(gain), float(self.gains.max()), float(self.gains.mean()), float(rank)
        )


class Records:
    """One JSON line a decision."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._path = folder / "decisions.jsonl"

    def found(self) -> list[Foresight]:
        lines = self._path.read_text().splitlines() if self._path.exists() else []
        return [Foresight(**json.loads(line)) for line in lines if line.endswith("}")]

    def append(self, one: Foresight) -> None:
        with self._path.open("a") as file:
            file.write(json.dumps(asdict(one)) + "\n")


def main(options: Options) -> None:
    console, records = Console(stderr=True), Records(options.out)
    done = {(it.method, it.category, it.task, it.state) for it in records.found() if it.unfolded == options.unfolded}
    with Launcher("sim", echo=False, logs=(options.out / "logs").absolute()) as cell:
        cell.wait_ready()
        for category, task, state, missing in wanted(options, done):
            lay_out(cell.bus, options, category, task, state)
            worth = worth_of(cell.bus, options, category, task)
            for name in missing:
                try:
                    rewards = rated(cell.bus, METHODS[name], category, task, worth.candidates)
                except MedorError as error:
                    console.print(f"{name}, {category} {state}: {error}", highlight=False)
                    continue
                one = replace(worth.judge(name, category, task, state, rewards), unfolded=options.unfolded)
                records.append(one)
                console.print(f"{category} {state} {task}  {name}  {one.gain:.2f} of {one.best:.2f}", highlight=False)
    those = (it for it in records.found() if it.method in options.methods and it.unfolded == options.unfolded)
    Console().print(table(those))


def wanted(options: Options, done: set) -> Iterator[tuple[Category, Task, int, list[str]]]:
    """State by state, so that an unfinished run has every category and method on the same first states."""
    for state in range(options.states):
        for category in options.categories:
            for task in options.tasks:
                missing = [name for name in options.methods if (name, category, task, state) not in done]
                if missing:
                    yield category, task, state, missing


def lay_out(bus: Bus, options: Options, category: Category, task: Task, state: int) -> None:
    """A garment as the measured pull will find it."""
    reset = ResetRequest(category=category, garment_seed=HELD_OUT_SEED + state, state=options.start, seed=state)
    if options.unfolded == 0:
        bus.ask(endpoints.RESET, reset)
        return
    bus.ask(
        endpoints.EPISODE,
        EpisodeRequest(category=category, task=task, max_picks=options.unfolded, seed=state, reset=reset),
    )


def worth_of(bus: Bus, options: Options, category: Category, task: Task) -> Worth:
    """Candidates on what lies on the table, rolled out by the solver on the true mesh."""
    count = options.candidates
    plan = bus.ask(
        endpoints.PLAN,
        PlanRequest(category=category, task=task, method="oracle", candidates=count, report=count, exhaustive=True),
    )
    score = bus.ask(endpoints.SCORE, Empty())
    room = score.flat_coverage_m2 - score.coverage_m2 if task == "flatten" else score.canonical_cost_m
    return Worth(Candidates(plan.top_picks, plan.top_places), (plan.top_rewards - plan.no_op_reward) / room)


def rated(bus: Bus, method: Method, category: Category, task: Task, candidates: Candidates) -> NDArray[np.float64]:
    """(K + 1,) a method's rewards: of doing nothing, then of the candidates."""
    cancel, view = threading.Event(), bus.ask(endpoints.CAPTURE, Empty())
    mesh = mesh_of(bus, method, category, view)
    if method.dynamics is None:
        raise BadRequest("it rates nothing")
    if method.judged:
        asked = PlanRequest(
            category=category, task=task, method=method.name, candidates=len(candidates), exhaustive=True
        )
        hearing, stages = Hearing(bus, Goals(bus)), Stages(Call(), lambda progress: None)
        choice = hearing.choice(method, asked, Scene(mesh, view), candidates, stages, cancel)
        return np.r_[choice.no_op_reward or 0.0, choice.rewards]
    reward = Reward(task=task, visible_only=method.visible_reward)
    if task == "canonicalize":
        reward = Goals(bus).reward(method, mesh, cancel)
    every = no_op(mesh) + candidates
    asked = RolloutRequest(mesh=mesh, picks=every.picks, places=every.places, reward=reward, backend=method.dynamics)
    return Shooting(bus, asked, cancel).rewards(on_fraction=lambda share: None)


def mesh_of(bus: Bus, method: Method, category: Category, view: DepthView) -> ClothMesh:
    if method.recon is None:
        return bus.ask(endpoints.TRUTH, Empty()).mesh
    return bus.ask(endpoints.RECONSTRUCT, ReconstructRequest(view=view, category=category, method=method.recon)).mesh


def table(found: Iterable[Foresight]) -> Table:
    """Means and their standard errors, by task and method."""
    groups: dict[tuple[str, str], list[Foresight]] = defaultdict(list)
    for one in found:
        groups[one.task, one.method].append(one)
    out = Table(
        "task", "method", "decisions", "gain of its choice", "of the best", "of a random one", "rank correlation"
    )
    for (task, method), those in sorted(groups.items()):
        gains = np.array([it.gain for it in those])
        error = gains.std() / len(gains) ** 0.5
        means = (np.mean([getattr(it, name) for it in those]) for name in ("best", "chance", "rank"))
        out.add_row(task, method, str(len(those)), f"{gains.mean():.3f} ± {error:.3f}", *(f"{it:.3f}" for it in means))
    return out


if __name__ == "__main__":
    heed_signals()
    sys.exit(main(tyro.cli(Options, description=__doc__)))
