"""Teaching a network canonical coordinates."""

import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import torch

from medor_cloth.dataset import Dataset, box_of
from medor_learn.loop import Schedule, train
from medor_recon.canonical.network import build
from medor_recon.canonical.preset import PRESETS, Preset
from medor_recon.canonical.task import CanonicalTask
from medor_recon.canonical.views import Views
from medor_wire.messages import Category

ENDLESS = 10**9
"""Steps of a run that ends by the clock."""


def canonical(
    categories: tuple[Category, ...],
    data: tuple[Path, ...],
    test: tuple[Path, ...],
    out: Path,
    preset: Literal["cpu", "paper-small", "paper", "garmentnets", "garmentnets-small"] = "cpu",
    start: Path | None = None,
    hours: float | None = None,
    steps: int | None = None,
    plain: bool = False,
    view: Literal["crop", "whole"] | None = None,
    batch: int | None = None,
    lr: float | None = None,
    seed: int = 0,
    validate_every: int = 1000,
    validated: int = 250,
    patience: int | None = None,
    threads: int = 1,
    device: str = "auto",
    tensorboard: bool = False,
) -> None:
    """Teach a network to say where on the garment each visible point is.

    The same command goes on where it was stopped.

    Args:
        categories: one, or several for a network that is told which one it sees.
        data: folders of recon data to learn from.
        test: folders of recon data of held-out garments.
        out: folder of the run; the best weights are in its folder best.
        preset: of the network and how it is taught.
        start: folder of weights to begin with instead of random ones.
        hours: of CPU time to spend over all resumptions; the learning rate decays with them.
        steps: to take; without hours, 20000 if left out.
        plain: compare with the labels as they are, without the turns that cannot be told apart.
        view: what the network sees, if not what the preset says.
        batch: views of a step, if not what the preset says.
        lr: highest learning rate, if not what the preset says.
        seed: of weights, batches and augmentation.
        validate_every: steps between two looks at the held-out garments.
        validated: views of each category to look at.
        patience: looks without improvement after which to stop.
        threads: of the CPU.
        device: cpu, cuda, or auto.
        tensorboard: write metrics for TensorBoard, too.
    """
    changes = {"view": view, "batch": batch, "lr": lr, "symmetric": False if plain else None}
    chosen = replace(PRESETS[preset], **{name: value for name, value in changes.items() if value is not None})
    views, held_out = Views.read(data, categories, "train"), Views.read(test, categories, "test")
    card = describe(chosen, preset, categories, data, seed) | {"views": {"train": len(views), "test": len(held_out)}}
    torch.manual_seed(seed)
    module = build(card).to(_device(device))
    schedule = Schedule(
        steps=steps or (ENDLESS if hours else Schedule.steps),
        hours=hours,
        lr=chosen.lr,
        weight_decay=1e-4,
        bf16=True,
        validate_every=validate_every,
        patience=patience,
        seed=seed,
        threads=threads,
    )
    task = CanonicalTask(module, chosen, views, held_out, seed, validated)
    done = train(task, out, schedule, card=card, start=start, tensorboard=tensorboard)
    sys.stdout.write(json.dumps(done) + "\n")


def describe(
    preset: Preset, name: str, categories: tuple[str, ...], data: tuple[Path, ...], seed: int
) -> dict[str, Any]:
    """All it takes to build the network again, and what it was taught with."""
    command = ["python", "-m", "medor_recon.train", "canonical", "--preset", name, "--categories", *categories]
    plans = [record.plan for folder in data for record in Dataset(folder).garments if record.category in categories]
    return {
        "model": "canonical",
        "command": shlex.join(command),
        "preset": preset.to_json(),
        "categories": list(categories),
        "nocs_boxes": {category: box_of(category) for category in categories},
        "data": [json.loads(plan) for plan in sorted({json.dumps(plan, sort_keys=True) for plan in plans})],
        "seed": seed,
    }


def _device(name: str) -> torch.device:
    return torch.device(("cuda" if torch.cuda.is_available() else "cpu") if name == "auto" else name)
