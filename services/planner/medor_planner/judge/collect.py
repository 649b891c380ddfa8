"""What the judge learns from: `python -m medor_planner.judge.collect --states 400 --out data/judge --shard 0/2`.

Starts a simulated cell and unfolds garments of the training seeds. At every state the models foresee what some
candidates would do, those that the last glance likes and some others, on the meshes that reconstruction makes of the
view, and the cloth solver rolls the same candidates out on the true garment. Then one of them is carried out: what the
last judge likes best, the truly best one, or any. So a judge learns from where the one before it leads.

A glance learns from what pulls truly bring, too, but hears no model: `--glances` collects that instead, more pulls a
minute. One file a state in `decisions` or `glances`; kill it and start it again: it goes on.
"""

import sys
import threading
import uuid
from collections.abc import Mapping, Sequence
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
from medor_planner.judge.glance import Glance
from medor_planner.judge.judge import SHIPPED, TASKS, Judge
from medor_planner.judge.opinions import COARSE, OPINIONS, Opinion, consulted, reconstructed
from medor_planner.judge.situation import DECISIONS, GLANCES, Outcomes, Situation, save
from medor_planner.plans import Plans
from medor_planner.sampling import Scene, sample
from medor_planner.screening import SCREEN_CHUNK, best
from medor_planner.shooting import CHUNK, Shooting
from medor_wire import endpoints
from medor_wire.bus import Bus
from medor_wire.errors import MedorError
from medor_wire.launcher import Launcher, heed_signals
from medor_wire.messages import (
    ActRequest,
    Category,
    ClothMesh,
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
    drawn: int = 500
    """Candidates drawn at a state."""
    best: int = 20
    """Of these, taken as the last glance rates them for the garment's task."""
    others: int = 10
    """Of the rest, taken at random."""
    glances: bool = False
    """No model is heard: lessons for a glance."""
    judge: Path | None = SHIPPED
    """Folder of the last judge's weights; `None`: there is none that knows today's features, models are trusted."""


def main(options: Options) -> None:
    part, parts = (int(number) for number in options.shard.split("/"))
    for folder in (DECISIONS, GLANCES):
        (options.out / folder).mkdir(parents=True, exist_ok=True)
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
        self._folder = GLANCES if options.glances else DECISIONS

    def collect(self) -> None:
        """Write the states that are not there yet. Raises what the cell's services do."""
        names = [f"{self._category}-{self._seed}-{k}.npz" for k in range(self._options.pulls)]
        if all((self._options.out / self._folder / name).exists() for name in names):
            return
        self._bus.ask(endpoints.RESET, ResetRequest(category=self._category, garment_seed=self._seed, seed=self._seed))
        with self._executor.hold() as robot:
            for name in names:
                robot.act(self._decided(robot.epoch, name))

    def _decided(self, epoch: int, name: str) -> ActRequest:
        """Write what there is to be learnt from the garment as it lies; one of the candidates to carry out."""
        view = self._bus.ask(endpoints.CAPTURE, Empty())
        heard: Sequence[Opinion] = () if self._options.glances else OPINIONS
        recons = [opinion.recon for opinion in heard or OPINIONS[:1]]
        meshes = reconstructed(self._bus, view, self._category, recons, self._never)
        mesh = meshes[OPINIONS[0].recon]
        candidates = sample(Scene(mesh, view), self._options.drawn, self._rng, reachable=self._reachable)
        goals = self._goals.of(canonical_of(mesh), self._never)
        drawn = Situation(view, mesh, candidates, goals, {})
        glanced = self._glanced(drawn, meshes)
        some = self._some(glanced)
        glanced, drawn = glanced[some], drawn.among(some)
        drawn = self._hearing(heard, meshes, drawn)
        outcomes = self._outcomes(drawn)
        save(self._options.out / self._folder / name, drawn, outcomes)
        judged = heard and self._options.judge
        gains = (glanced + Judge.load(judged).gains(drawn)) / 2 if judged else glanced
        truth = np.stack([outcomes.coverage_m2, -outcomes.cost_m], axis=1)[1:]
        chosen = self._chosen(gains, truth)
        return ActRequest(
            action_id=f"{name}-{uuid.uuid4().hex}",
            epoch=epoch,
            pick=drawn.candidates.picks[chosen].astype(np.float64),
            place=drawn.candidates.places[chosen].astype(np.float64),
        )

    def _reachable(self, picks: NDArray[np.float32], places: NDArray[np.float32]) -> NDArray[np.bool_]:
        return self._bus.ask(endpoints.REACH, ReachRequest(points=picks, places=places)).reachable

    def _hearing(
        self, opinions: Sequence[Opinion], meshes: Mapping[str, ClothMesh], situation: Situation, chunk: int = CHUNK
    ) -> Situation:
        """The same decision when models have been heard about all its candidates."""
        return situation.hearing(consulted(self._bus, opinions, meshes, situation.candidates, self._never, chunk=chunk))

    def _some(self, gains: NDArray) -> NDArray[np.bool_]:
        """(K,) the best of the candidates, by what is expected of them (K, 2), and some of the others."""
        chosen = best(gains[:, TASKS.index(self._task)], self._options.best)
        chosen[self._rng.permutation(np.flatnonzero(~chosen))[: self._options.others]] = True
        return chosen

    def _glanced(self, situation: Situation, meshes: Mapping[str, ClothMesh]) -> NDArray[np.float32]:
        """(K, 2) what to expect of candidates: what a glance says or, without one, the rough model."""
        if self._options.judge:
            return Glance.load(self._options.judge).gains(situation)
        first, goals = self._hearing([COARSE], meshes, situation, SCREEN_CHUNK).foreseen[COARSE.name], situation.goals
        covered = coverages(first.positions, first.mesh.faces, threads=1) / goals.flat_coverage_m2
        cost = canonical_cost(first.positions, goals.goals)
        return np.stack([covered[1:] - covered[0], cost[0] - cost[1:]], axis=1).astype(np.float32)

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

    def _chosen(self, gains: NDArray, truth: NDArray) -> int:
        """Which candidate to carry out, of what is expected of them (K, 2) and what truly comes."""
        drawn, column = self._rng.random(), TASKS.index(self._task)
        if drawn < BY_JUDGE:
            return int(gains[:, column].argmax())
        if drawn < BY_TRUTH:
            return int(truth[:, column].argmax())
        return int(self._rng.integers(len(gains)))


if __name__ == "__main__":
    heed_signals()
    sys.exit(main(tyro.cli(Options, description=__doc__)))
