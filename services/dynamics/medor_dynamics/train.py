"""Learn cloth dynamics: `python -m medor_dynamics.train --preset cpu --data DIR --test DIR --out DIR --hours H`.

The data come from `python -m medor_sim.collect dynamics`. The same command goes on where it was stopped; the weights
to use are in `best` of the folder written to.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
import tyro

from medor_cloth.dataset import Dataset
from medor_dynamics.foresight import Foresight
from medor_dynamics.model import Dynamics
from medor_dynamics.preset import PRESETS, Preset
from medor_dynamics.samples import Recording, Sampler, recordings
from medor_learn.loop import Schedule, train


@dataclass(frozen=True)
class Options:
    """What to learn, from what, for how long."""

    data: Path
    """Data set of training garments; of several categories, all are learnt from."""
    test: Path
    """Data set of held-out garments."""
    out: Path
    preset: Literal["cpu", "paper"] = "cpu"
    start: Path | None = None
    """Folder of weights to begin with instead of random ones."""
    hours: float | None = None
    """CPU hours, over all resumptions."""
    steps: int = 1_000_000
    batch: int = 8
    """Pulls in a batch."""
    unroll: int = 1
    """Model steps per sample; the loss is taken after each."""
    noise: float = 0.0
    """Errors added to the velocities the model sees [m/s]."""
    mirror: bool = True
    """Show half of the samples in a mirror."""
    turn: bool = False
    """Turn samples at random; for a model that thinks in the world's axes."""
    visible_only: bool = False
    """Learn the part of the cloth that the camera sees, for the partial-mesh baseline."""
    width: int | None = None
    blocks: int | None = None
    nearest: int | None = None
    """Collision edges into a node, 0 for all."""
    rest: Literal["start", "true"] | None = None
    frame: Literal["world", "pull"] | None = None
    normalize: bool | None = None
    length_passes: int | None = None
    """By which edges get their lengths back after every step, 0: none."""
    lr: float = 1e-3
    bf16: bool = True
    validate_every: int = 1000
    validate_on: int = 64
    """Held-out pulls looked at in a validation, spread over the data set."""
    patience: int | None = None
    """Validations without a better score after which to stop."""
    threads: int = 1
    seed: int = 0
    tensorboard: bool = False


def main(options: Options) -> None:
    preset = preset_of(options)
    training, test = Dataset(options.data), Dataset(options.test)
    if (training.split, test.split) != ("train", "test"):
        raise SystemExit(f"expected splits train and test, got {training.split} and {test.split}")
    torch.manual_seed(options.seed)
    task = Foresight(
        Dynamics(preset),
        Sampler(
            recordings(training, preset, visible_only=options.visible_only),
            options.batch,
            options.unroll,
            options.noise,
            options.mirror,
            options.turn,
            seed=options.seed,
        ),
        spread(recordings(test, preset, visible_only=options.visible_only), options.validate_on),
    )
    task.module.to("cuda" if torch.cuda.is_available() else "cpu")
    schedule = Schedule(
        steps=options.steps,
        hours=options.hours,
        lr=options.lr,
        bf16=options.bf16,
        validate_every=options.validate_every,
        patience=options.patience,
        seed=options.seed,
        threads=options.threads,
    )
    facts = card(options, preset, training)
    train(task, options.out, schedule, card=facts, start=options.start, tensorboard=options.tensorboard)


def preset_of(options: Options) -> Preset:
    """The named preset with what was asked to be different."""
    names = ("width", "blocks", "nearest", "rest", "frame", "normalize", "length_passes")
    asked = {name: value for name in names if (value := getattr(options, name)) is not None}
    return replace(PRESETS[options.preset], **asked)


def spread(recordings: list[Recording], at_most: int) -> list[Recording]:
    """Some recordings, evenly over all."""
    chosen = np.linspace(0, len(recordings) - 1, min(at_most, len(recordings))).round().astype(int)
    return [recordings[index] for index in chosen]


def card(options: Options, preset: Preset, training: Dataset) -> dict[str, Any]:
    """All it takes to build the model, and what it learnt from."""
    sampling = {name: getattr(options, name) for name in ("batch", "unroll", "noise", "mirror", "turn", "visible_only")}
    asked = ("preset", "hours", "batch", "unroll", "noise", "lr", "seed")
    words = [f"--{name} {value}" for name in asked if (value := getattr(options, name)) is not None]
    return {
        "command": " ".join(["python -m medor_dynamics.train", *words]),
        "preset": asdict(preset),
        "training": sampling | {"seed": options.seed},
        "data": {
            "categories": sorted({record.category for record in training.garments}),
            "garments": len(training.garments),
            "pulls": len(training),
            "plan_seeds": sorted({record.plan["seed"] for record in training.garments}),
        },
    }


if __name__ == "__main__":
    main(tyro.cli(Options))
