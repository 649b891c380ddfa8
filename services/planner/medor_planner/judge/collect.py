"""What the judge learns from: `python -m medor_planner.judge.collect --states 400 --out data/judge --shard 0/2`.

Starts a simulated cell and unfolds garments of the training seeds. At every state the models foresee what some
candidates would do, on the meshes that reconstruction makes of the view, and the cloth solver rolls the same
candidates out on the true garment. Then one of them is carried out: what the last judge likes best, the truly best
one, or any. So a judge learns from where the one before it leads. One file a state; kill it and start it again: it goes
on.
"""

import sys
import threading
import uuid
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from medor_cloth.alignment import canonical_cost
from medor_cloth.coverage import coverages
from medor_planner.executor import Executor
from medor_planner.goals import Goals, canonical_of
from medor_planner.judge.judge import ALL, SCREEN, SHIPPED, Judge
from medor_planner.judge.opinions import COARSE, OPINIONS, consulted, reconstructed
from medor_planner.judge.situation import Outcomes, Situation, save
from medor_planner.plans import Plans
from medor_planner.sampling import Scene, sample
from medor_planner.screening import SCREEN_CHUNK
from medor_planner.shooting import Shooting
from medor_wire import endpoints
from medor_wire.bus import Bus
from medor_wire.errors import MedorError
from medor_wire.holding import Holding
from medor_wire.launcher import Launcher, heed_signals
from medor_wire.messages import (
    ActRequest,
    Category,
    Empty,
    ReachRequest,
    ResetRequest,
    Reward,
    RolloutRequest,
    Task,
)

FIRST_SEED = 600_000
"""Garments that no other network has learnt from; held-out ones begin at 800000."""
CATEGORIES: tuple[Category, ...] = ("trousers", "tshirt", "dress", "skirt", "jumpsuit")
TASKS: tuple[Task, ...] = ("flatten", "canonicalize")
BY_JUDGE, BY_TRUTH = 0.65, 0.85
"""Shares of the pulls carried out, summed up: the judge's favourite, the truly best one; what is left: any."""


@dataclass(frozen=True)
class Options:
    """How much to collect."""

    out: Path
    states: int = 400
    """Of all shards together."""
    shard: str = "0/1"
    """Which part, of how many: `i/N`, counted from 0."""
    categories: tuple[Category, ...] = CATEGORIES
    first_seed: int = FIRST_SEED
    """Of the garments; others than the last judge learnt from make its merit and the next one's comparable."""
    pulls: int = 7
    """States of one garment, each a pull after the last."""
    drawn: int = 120
    """Candidates drawn at a state."""
    best: int = 14
    """Of these, taken as the screening judge rates them, half of them for each task."""
    others: int = 10
    """Of the rest, taken at random."""
    judge: Path | None = SHIPPED
    """Folder of the last judge's weights; `None`: there is none that knows today's features, models are trusted."""


def main(options: Options) -> None:
    part, parts = (int(number) for number in options.shard.split("/"))
    options.out.mkdir(parents=True, exist_ok=True)
    garments = range(part, -(-options.states // options.pulls), parts)
    environment = {"MEDOR_DYNAMICS__REPLICAS": "1", "MEDOR_DYNAMICS__THREADS": "1"}
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with (
        Launcher("sim", echo=False, environment=environment, logs=(options.out / f"logs-{part}").absolute()) as cell,
        Progress(*columns) as bar,
    ):
        cell.wait_ready()
        task = bar.add_task("garments", total=len(garments))
        for number in garments:
            category: Category = options.categories[number % len(options.categories)]
            try:
                Garment(cell.bus, options, category, options.first_seed + number).collect()
            except MedorError as error:
                bar.console.print(f"{category} {options.first_seed + number}: {error}", highlight=False)
            bar.advance(task)


class Garment:
    """One garment on its way through a few pulls. The same options and seed give the same states."""

    def __init__(self, bus: Bus, options: Options, category: Category, seed: int) -> None:
        self._bus, self._options, self._seed = bus, options, seed
        self._category: Category = category
        self._goals, self._rng = Goals(bus), np.random.default_rng(seed)
        self._task: Task = TASKS[int(self._rng.integers(len(TASKS)))]
        self._executor = Executor(bus, Plans())
        self._never = threading.Event()

    def collect(self) -> None:
        """Write the states that are not there yet. Raises what the cell's services do."""
        paths = [self._options.out / f"{self._category}-{self._seed}-{k}.npz" for k in range(self._options.pulls)]
        if all(path.exists() for path in paths):
            return
        self._bus.ask(endpoints.RESET, ResetRequest(category=self._category, garment_seed=self._seed, seed=self._seed))
        with self._executor.hold() as robot:
            for path in paths:
                situation, outcomes = self._decision()
                save(path, situation, outcomes)
                self._act(robot, situation, outcomes, path.stem)

    def _decision(self) -> tuple[Situation, Outcomes]:
        view = self._bus.ask(endpoints.CAPTURE, Empty())
        wanted = (opinion.recon for opinion in OPINIONS)
        meshes = reconstructed(self._bus, view, self._category, wanted, self._never)
        mesh = meshes[OPINIONS[0].recon]
        candidates = sample(Scene(mesh, view), self._options.drawn, self._rng, reachable=self._reachable)
        goals = self._goals.of(canonical_of(mesh), self._never)
        rough = consulted(self._bus, [COARSE], meshes, candidates, self._never, chunk=SCREEN_CHUNK)
        drawn = Situation(view, mesh, candidates, goals, rough)
        some = drawn.among(self._some(drawn))
        others = [opinion for opinion in OPINIONS if opinion is not COARSE]
        situation = some.hearing(consulted(self._bus, others, meshes, some.candidates, self._never))
        return situation, self._outcomes(situation)

    def _reachable(self, picks: NDArray[np.float32], places: NDArray[np.float32]) -> NDArray[np.bool_]:
        return self._bus.ask(endpoints.REACH, ReachRequest(points=picks, places=places)).reachable

    def _some(self, drawn: Situation) -> NDArray[np.bool_]:
        """(K,) the best of the candidates, as the screen rates them for either task, and some of the others."""
        chosen = np.zeros(len(drawn.candidates), np.bool_)
        for task in TASKS:
            chosen[np.argsort(-self._rated(drawn, SCREEN, task), kind="stable")[: self._options.best // 2]] = True
        chosen[self._rng.permutation(np.flatnonzero(~chosen))[: self._options.others]] = True
        return chosen

    def _rated(self, situation: Situation, judge: str, task: Task) -> NDArray[np.float64]:
        """(K,) what to expect of candidates: what the last judge says or, without one, the first model heard."""
        if self._options.judge:
            return Judge.load(judge, self._options.judge).rated(situation, task)[0]
        first = next(iter(situation.foreseen.values()))
        if task == "flatten":
            return coverages(first.positions[1:], first.mesh.faces, threads=1)
        return -canonical_cost(first.positions[1:], situation.goals.goals)

    def _outcomes(self, situation: Situation) -> Outcomes:
        """What the candidates do to the true garment."""
        truth, candidates = self._bus.ask(endpoints.TRUTH, Empty()).mesh, situation.candidates
        reward = Reward(task="flatten")
        asked = RolloutRequest(
            mesh=truth, picks=candidates.picks, places=candidates.places, reward=reward, backend="physics"
        )
        positions, _ = Shooting(self._bus, asked, self._never).rollouts(on_fraction=lambda share: None)
        states = np.concatenate([truth.vertices[None], positions])
        goals = self._goals.of(canonical_of(truth), self._never)
        return Outcomes(
            coverage_m2=coverages(states, truth.faces, threads=1),
            cost_m=canonical_cost(states, goals.goals),
            in_view=situation.camera.contains(states).mean(axis=1),
            flat_coverage_m2=goals.flat_coverage_m2,
            seed=self._seed,
        )

    def _act(self, robot: Holding, situation: Situation, outcomes: Outcomes, name: str) -> None:
        """Carry one of the candidates out."""
        drawn, truth = self._rng.random(), {"flatten": outcomes.coverage_m2, "canonicalize": -outcomes.cost_m}
        if drawn < BY_JUDGE:
            favourite = self._rated(situation, ALL, self._task).argmax()
        elif drawn < BY_TRUTH:
            favourite = truth[self._task][1:].argmax()
        else:
            favourite = self._rng.integers(len(situation.candidates))
        pick, place = situation.candidates.picks[favourite], situation.candidates.places[favourite]
        robot.act(
            ActRequest(
                action_id=f"{name}-{uuid.uuid4().hex}",
                epoch=robot.epoch,
                pick=pick.astype(np.float64),
                place=place.astype(np.float64),
            )
        )


if __name__ == "__main__":
    heed_signals()
    sys.exit(main(tyro.cli(Options, description=__doc__)))
