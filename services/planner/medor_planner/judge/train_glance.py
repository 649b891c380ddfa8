"""Teach a glance: `python -m medor_planner.judge.train_glance --data data/judge --out runs/glance`.

Learns from what pulls truly brought (`medor_planner.judge.collect`, with `--glances` or without); one garment in eight
is held out. A few minutes on two cores; the same command goes on where it was stopped. The best weights are in `best`;
in the folder `glance` of the judges' they are used.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from torch import Tensor, nn

from medor_learn.loop import Schedule, train
from medor_learn.run import SCORE
from medor_planner.judge.features import features, mirrored
from medor_planner.judge.glance import GlanceNet
from medor_planner.judge.judge import TASKS
from medor_planner.judge.lessons import gained
from medor_planner.judge.merit import best_few, merit
from medor_planner.judge.patches import Maps, Patches
from medor_planner.judge.situation import DECISIONS, GLANCES, load

HELD_OUT = 8
"""One garment in so many."""
NOISE = 0.05
"""On the features, in standard deviations."""


@dataclass(frozen=True)
class Options:
    """How to learn."""

    data: tuple[Path, ...]
    """Folders that `medor_planner.judge.collect` filled."""
    out: Path
    epochs: int = 15
    batch: int = 128
    lr: float = 1e-3
    decay: float = 0.05
    seed: int = 0
    threads: int = 1
    start: Path | None = None
    """Folder of weights to go on from."""


@dataclass(frozen=True, eq=False)
class Sights:
    """Pulls of many states.

    Attributes:
        names: (F) features.
        patches: of N pulls.
        values: (N, F).
        gains: (N, 2) share of the flat coverage, metres of canonical cost.
        state: (N,) number of the state.
        garment: (N,) seed of the garment.
    """

    names: tuple[str, ...]
    patches: Patches
    values: NDArray[np.float32]
    gains: NDArray[np.float32]
    state: NDArray[np.int64]
    garment: NDArray[np.int64]

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Self:
        names: tuple[str, ...] = ()
        patches, values, gains, garment = [], [], [], []
        for path in track(paths, "patches", console=Console(stderr=True), transient=True):
            situation, outcomes = load(path)
            situation = situation.heard([])
            names, known = features(situation)
            patches.append(Maps.of(situation).around(situation.candidates))
            values.append(known)
            gains.append(gained(outcomes))
            garment.append(np.full(len(known), outcomes.seed))
        state = np.repeat(np.arange(len(values)), [len(known) for known in values])
        every = Patches(np.concatenate([it.near for it in patches]), np.concatenate([it.wide for it in patches]))
        return cls(names, every, np.concatenate(values), np.concatenate(gains), state, np.concatenate(garment))

    def __len__(self) -> int:
        return len(self.values)

    def of(self, rows: NDArray) -> Self:
        """Some of the pulls, by number or by mask."""
        patches = Patches(self.patches.near[rows], self.patches.wide[rows])
        return replace(
            self,
            patches=patches,
            values=self.values[rows],
            gains=self.gains[rows],
            state=self.state[rows],
            garment=self.garment[rows],
        )

    def mirrored(self) -> Self:
        """The same in a mirror."""
        return replace(self, patches=self.patches.mirrored, values=self.values[:, mirrored(self.names)])


class GlanceTask:
    """Pulls, as they are or in a mirror, and what they brought: a task for `medor_learn.loop.train`."""

    def __init__(self, module: GlanceNet, taught: Sights, held_out: Sights, batch: int, seed: int) -> None:
        self.module, self._taught, self._held_out = module, taught, held_out
        self._batch, self._seed = batch, seed

    def loss(self, step: int) -> Tensor:
        """Huber's, in units."""
        rng = np.random.default_rng((self._seed, step))
        some = self._taught.of(rng.integers(len(self._taught), size=self._batch))
        if rng.random() < 0.5:
            some = some.mirrored()
        near, wide, values, gains = (
            torch.from_numpy(it).float() for it in (some.patches.near, some.patches.wide, some.values, some.gains)
        )
        values += NOISE * self.module.scale * torch.randn_like(values)
        said = self.module(near, wide, values)
        return nn.functional.smooth_l1_loss(said, (gains / self.module.unit).expand_as(said))

    def validate(self) -> dict[str, float]:
        """The same loss, and the merit of its word, on held-out garments."""
        there = self._held_out
        said, unit = self.module.gains(there.patches, there.names, there.values), self.module.unit.numpy()
        apart = torch.from_numpy(said / unit), torch.from_numpy(there.gains / unit)
        found = {SCORE: float(nn.functional.smooth_l1_loss(*apart))}
        for column, task in enumerate(TASKS):
            one = merit(said[:, column], there.gains[:, column], there.state)
            found |= {f"{task} rank": one.rank, f"{task} favourite brings": one.gain}
            for who, rated in (("few bring", said), ("few could bring", there.gains)):
                found[f"{task} {who}"] = best_few(rated[:, column], there.gains[:, column], there.state)
        return found


def main(options: Options) -> None:
    folders = [folder / kind for folder in options.data for kind in (GLANCES, DECISIONS)]
    paths = sorted(path for folder in folders for path in folder.glob("*.npz"))
    if not paths:
        raise SystemExit("no states; collect some with `python -m medor_planner.judge.collect --glances`")
    sights = Sights.read(paths)
    garments = np.unique(sights.garment)
    aside = np.isin(sights.garment, garments[::HELD_OUT])
    taught, held_out = sights.of(~aside), sights.of(aside)
    torch.manual_seed(options.seed)
    network = GlanceNet(len(sights.names))
    network.mean.copy_(torch.from_numpy(taught.values.mean(axis=0)))
    network.scale.copy_(torch.from_numpy(taught.values.std(axis=0) + 1e-6))
    of_an_epoch = max(len(taught) // options.batch, 1)
    schedule = Schedule(
        steps=options.epochs * of_an_epoch,
        lr=options.lr,
        weight_decay=options.decay,
        validate_every=of_an_epoch,
        seed=options.seed,
        threads=options.threads,
    )
    card = {
        "What it is": "Rates pick-and-place candidates at first sight: the gain in coverage and in closeness to the "
        "canonical pose to expect of each, from maps of what the camera sees and of what the mesh believes around it.",
        "features": list(sights.names),
        "data": {
            "states": int(sights.state[-1]) + 1,
            "pulls": len(sights),
            "garment_seeds": [int(garments[0]), int(garments[-1])],
            "held_out": [int(seed) for seed in garments[::HELD_OUT]],
        },
    }
    task = GlanceTask(network, taught, held_out, options.batch, options.seed)
    done = train(task, options.out, schedule, card=card, start=options.start)
    sys.stdout.write(json.dumps(done) + "\n")


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
