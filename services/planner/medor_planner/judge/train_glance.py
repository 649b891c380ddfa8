"""Teach a glance: `python -m medor_planner.judge.train_glance --data data/judge --out runs/glance`.

Learns from what pulls truly brought (`medor_planner.judge.collect`, with `--glances` or without); one garment in eight
is held out. A few minutes on two cores; the same command goes on where it was stopped. The best weights are in `best`,
or in `blended` where they are to stay near those that they began with; in the folder `glance` of the judges' they are
used.
"""

import json
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from torch import Tensor, nn

from medor_learn import weights
from medor_learn.loop import Schedule, train
from medor_learn.run import SCORE
from medor_planner.judge.features import mirrored
from medor_planner.judge.glance import GlanceNet, promised
from medor_planner.judge.judge import TASKS
from medor_planner.judge.lessons import Lessons, stored
from medor_planner.judge.merit import best_few, merit
from medor_planner.judge.patches import Maps, Patches
from medor_planner.judge.situation import DECISIONS, GLANCES, Outcomes, Situation

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
    keep: float = 0.0
    """Share of these weights in what is left in `blended`, the last weights being the rest: half of them remembers
    lessons that are not among the data any more, and does better than either."""


@dataclass(frozen=True, eq=False)
class Sights:
    """Lessons before any model is heard, with what is seen of each pull."""

    lessons: Lessons
    patches: Patches

    @classmethod
    def read(cls, paths: Sequence[Path]) -> Self:
        """All states that were collected."""
        patches: list[Patches] = []

        def seen() -> Iterator[tuple[Situation, Outcomes]]:
            for situation, outcomes in stored(paths):
                patches.append(Maps.of(situation).around(situation.candidates))
                yield situation.heard([]), outcomes

        lessons = Lessons.of(seen())
        near, wide = (np.concatenate([getattr(it, maps) for it in patches]) for maps in ("near", "wide"))
        return cls(lessons, Patches(near, wide))

    def where(self, chosen: NDArray) -> Self:
        """Some of the pulls, by number or by mask."""
        patches = Patches(self.patches.near[chosen], self.patches.wide[chosen])
        return replace(self, lessons=self.lessons.where(chosen), patches=patches)

    def mirrored(self) -> Self:
        """The same in a mirror."""
        lessons = replace(self.lessons, values=self.lessons.values[:, mirrored(self.lessons.names)])
        return replace(self, lessons=lessons, patches=self.patches.mirrored)


class GlanceTask:
    """Pulls, as they are or in a mirror, and what they brought: a task for `medor_learn.loop.train`."""

    def __init__(self, module: GlanceNet, taught: Sights, held_out: Sights, batch: int, seed: int) -> None:
        self.module, self._taught, self._held_out = module, taught, held_out
        self._batch, self._seed = batch, seed

    def loss(self, step: int) -> Tensor:
        """Huber's, in units."""
        rng = np.random.default_rng((self._seed, step))
        some = self._taught.where(rng.integers(len(self._taught.lessons), size=self._batch))
        if rng.random() < 0.5:
            some = some.mirrored()
        near, wide, values, gains = (
            torch.from_numpy(it).float()
            for it in (some.patches.near, some.patches.wide, some.lessons.values, some.lessons.gains)
        )
        values += NOISE * self.module.scale * torch.randn_like(values)
        said = self.module(near, wide, values)
        return nn.functional.smooth_l1_loss(said, (gains / self.module.unit).expand_as(said))

    def validate(self) -> dict[str, float]:
        """The same loss, and the merit of its word, on held-out garments; with and without the caution of its word."""
        there, unit = self._held_out.lessons, self.module.unit.numpy()
        words = self.module.words(self._held_out.patches, there.names, there.values)
        mean = words.mean(axis=0)
        off = nn.functional.smooth_l1_loss(torch.from_numpy(mean / unit), torch.from_numpy(there.gains / unit))
        found = {SCORE: float(off)}
        for who, rated in (("", promised(words)), (" without caution", mean)):
            for column, task in enumerate(TASKS):
                one = merit(rated[:, column], there.gains[:, column], there.state)
                few = best_few(rated[:, column], there.gains[:, column], there.state)
                found |= {f"{task} rank{who}": one.rank, f"{task} favourite{who} brings": one.gain}
                found[f"{task} few{who} bring"] = few
        for column, task in enumerate(TASKS):
            gains = there.gains[:, column]
            found[f"{task} few could bring"] = best_few(gains, gains, there.state)
        return found


def main(options: Options) -> None:
    if options.keep and not options.start:
        raise SystemExit("--keep: a share of which weights? name their folder with --start")
    folders = [folder / kind for folder in options.data for kind in (GLANCES, DECISIONS)]
    paths = sorted(path for folder in folders for path in folder.glob("*.npz"))
    if not paths:
        raise SystemExit("no states; collect some with `python -m medor_planner.judge.collect --glances`")
    sights = Sights.read(paths)
    lessons = sights.lessons
    garments = np.unique(lessons.garment)
    aside = np.isin(lessons.garment, garments[::HELD_OUT])
    taught, held_out = sights.where(~aside), sights.where(aside)
    torch.manual_seed(options.seed)
    network = GlanceNet(len(lessons.names))
    network.mean.copy_(torch.from_numpy(taught.lessons.values.mean(axis=0)))
    network.scale.copy_(torch.from_numpy(taught.lessons.values.std(axis=0) + 1e-6))
    of_an_epoch = max(len(taught.lessons) // options.batch, 1)
    schedule = Schedule(
        steps=options.epochs * of_an_epoch,
        lr=options.lr,
        weight_decay=options.decay,
        validate_every=of_an_epoch,
        seed=options.seed,
        threads=options.threads,
    )
    command = ["python", "-m", "medor_planner.judge.train_glance"]
    asked = ("epochs", "batch", "lr", "decay", "seed", "threads", "keep")
    command += [word for name in asked for word in (f"--{name}", str(getattr(options, name)))]
    card = {
        "What it is": "Rates pick-and-place candidates at first sight: the gain in coverage and in closeness to the "
        "canonical pose to expect of each, from maps of what the camera sees and of what the mesh believes around it.",
        "command": shlex.join(command),
        "features": list(lessons.names),
        "data": {
            "states": int(lessons.state[-1]) + 1,
            "pulls": len(lessons),
            "garment_seeds": [int(garments[0]), int(garments[-1])],
            "held_out": [int(seed) for seed in garments[::HELD_OUT]],
        },
    }
    task = GlanceTask(network, taught, held_out, options.batch, options.seed)
    done = train(task, options.out, schedule, card=card, start=options.start)
    if options.keep and options.start and done["ended"] != "interrupted":
        done["blended"] = blend(task, options.out, options.start, options.keep)
    sys.stdout.write(json.dumps(done) + "\n")


def blend(task: GlanceTask, out: Path, start: Path, keep: float) -> dict[str, float]:
    """Mean of the weights that a task ended with and of those that it began with (WiSE-FT, Wortsman et al. 2022,
    section 3), examined and left in `blended`. Returns what came of the examination."""
    module = task.module.eval()
    last = {name: tensor.clone() for name, tensor in module.state_dict().items()}
    weights.start(module, start)
    module.load_state_dict(
        {
            name: torch.lerp(last[name].double(), tensor.double(), keep).to(tensor.dtype)
            for name, tensor in module.state_dict().items()
        }
    )
    config = weights.read_config(out / "best") | {"metrics": task.validate(), "kept of the start": keep}
    weights.save(out / "blended", module, config, config)
    return config["metrics"]


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
