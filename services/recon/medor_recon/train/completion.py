"""Teaching a network to complete canonicalised views."""

import json
import shlex
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch

from medor_learn import weights
from medor_learn.loop import Schedule, Task, train
from medor_recon.canonical.canonicalizer import Canonicalizer
from medor_recon.completion.augment import example
from medor_recon.completion.field import Field, FieldConfig
from medor_recon.completion.field_task import FieldTask
from medor_recon.completion.fill import PooledFill
from medor_recon.completion.fill_task import FillTask
from medor_recon.completion.finish import choose_templates, choose_threshold, measure
from medor_recon.completion.material import Material
from medor_recon.completion.observations import Observation, observations, split
from medor_recon.completion.predictions import Predictions
from medor_recon.completion.presets import PRESETS, Preset
from medor_recon.completion.weights import build, describe, load, templates_path
from medor_wire.messages import Category

ENDLESS = 10**9
"""Steps of a run that ends by the clock."""
THRESHOLD_VIEWS = 20
"""Held-out views of a category that its threshold is chosen on."""
MEASURED_VIEWS = 40
"""Held-out views whose whole meshes are measured in the end."""


def completion(
    categories: tuple[Category, ...],
    data: tuple[Path, ...],
    out: Path,
    preset: Literal[
        "cpu",
        "paper-small",
        "paper-small-no-relative",
        "garmentnets-small",
        "paper",
        "paper-no-relative",
        "garmentnets",
    ] = "cpu",
    canonical: Path | None = None,
    predicted: float | None = None,
    held_out: float = 0.1,
    start: Path | None = None,
    hours: float | None = None,
    steps: int | None = None,
    batch: int | None = None,
    lr: float | None = None,
    seed: int = 0,
    validate_every: int = 1000,
    validated: int = 100,
    patience: int | None = None,
    bf16: bool = True,
    threads: int = 1,
    device: str = "auto",
    tensorboard: bool = False,
) -> None:
    """Teach a network where the whole garment lies, hidden parts included, from its canonicalised view.

    The same command goes on where it was stopped.

    Args:
        categories: one, or several for a network that is told which one it sees.
        data: folders of recon data of the training split.
        out: folder of the run; the best weights are in its folder best.
        preset: of the network and how it is taught.
        canonical: folder of weights of a canonicaliser whose views are learnt from, too.
        predicted: share of these views, if not what the preset says; the others have true coordinates with errors.
        held_out: share of the garments to validate on, the last of every so many.
        start: folder of weights to begin with instead of random ones.
        hours: of CPU time to spend over all resumptions; the learning rate decays with them.
        steps: to take; without hours, 20000 if left out.
        batch: views of a step, if not what the preset says.
        lr: highest learning rate, if not what the preset says.
        seed: of weights, batches and augmentation.
        validate_every: steps between two looks at the held-out garments.
        validated: views to look at.
        patience: looks without improvement after which to stop.
        bf16: run the volumes of a field in bfloat16.
        threads: of the CPU.
        device: cpu, cuda, or auto.
        tensorboard: write metrics for TensorBoard, too.
    """
    chosen = _changed(PRESETS[preset], canonical, predicted, batch, lr)
    device = ("cuda" if torch.cuda.is_available() else "cpu") if device == "auto" else device
    material = _material(chosen, categories, data, held_out, canonical, out / "predictions", validated)
    command = ["python", "-m", "medor_recon.train", "completion", "--preset", preset, "--categories", *categories]
    card = _card(chosen, material, categories) | {"preset": preset, "command": shlex.join(command), "seed": seed}
    card["canonical"] = weights.read_config(canonical) if canonical else None
    torch.manual_seed(seed)
    schedule = Schedule(
        steps=steps or (ENDLESS if hours else Schedule.steps),
        hours=hours,
        lr=chosen.lr,
        bf16=bf16 and isinstance(chosen.network, FieldConfig),
        validate_every=validate_every,
        patience=patience,
        seed=seed,
        threads=threads,
    )
    task = _task(chosen, material, card, seed, device)
    done = train(task, out, schedule, card=card, start=start, tensorboard=tensorboard)
    if done["ended"] != "interrupted":
        done["meshes"] = finish(out / "best", chosen, material, device)
    sys.stdout.write(json.dumps(done) + "\n")


def finish(best: Path, preset: Preset, material: Material, device: str) -> dict[str, Any]:
    """Templates or thresholds beside the best weights, and measures of whole meshes in their card."""
    module, config = weights.load(best, build, device)
    for category in config["categories"] if preset.templates else []:
        templates = choose_templates(material.learn, category, preset.templates)
        templates_path(best, category).write_bytes(templates.to_bytes())
    if isinstance(module, Field):
        config["thresholds"] = {category: _threshold(module, material, category) for category in config["categories"]}
        weights.save(best, module, config, config)
    config["meshes"] = measure(load(best, device), material, _evenly(material.held_out, MEASURED_VIEWS))
    weights.save(best, module, config, config)
    return config["meshes"]


def _changed(
    preset: Preset, canonical: Path | None, predicted: float | None, batch: int | None, lr: float | None
) -> Preset:
    """The preset with what the command says otherwise; without a canonicaliser nothing is predicted."""
    share = preset.augmentation.predicted if predicted is None else predicted
    augmentation = replace(preset.augmentation, predicted=share if canonical else 0.0)
    return replace(preset, augmentation=augmentation, batch=batch or preset.batch, lr=lr or preset.lr)


def _material(
    preset: Preset,
    categories: tuple[Category, ...],
    data: tuple[Path, ...],
    held_out: float,
    canonical: Path | None,
    cache: Path,
    validated: int,
) -> Material:
    reads_features = isinstance(preset.network, FieldConfig) and preset.network.features > 0
    if reads_features and canonical is None:
        raise SystemExit("train: this preset reads the features of a canonicaliser; expected --canonical")
    predictions = None
    if canonical:
        canonicalizer = Canonicalizer.load(canonical)
        predictions = Predictions(canonicalizer.canonicalize, cache, preset.spacing, reads_features)
    found = [view for folder in data for view in observations(folder, categories, preset.spacing)]
    return Material(*split(found, held_out), predictions, validated, only_predicted=reads_features)


def _card(preset: Preset, material: Material, categories: tuple[str, ...]) -> dict[str, Any]:
    learn, held_out = material.learn, material.held_out
    plans = {json.dumps(one.shape.record.plan, sort_keys=True) for one in learn}
    return describe(preset.network, categories) | {
        "spacing": preset.spacing,
        "augmentation": asdict(preset.augmentation),
        "batch": preset.batch,
        "data": [json.loads(plan) for plan in sorted(plans)],
        "views": {"train": len(learn), "held out": len(held_out)},
        "garments": {
            "train": len({id(one.shape) for one in learn}),
            "held out": len({id(one.shape) for one in held_out}),
        },
    }


def _task(preset: Preset, material: Material, card: dict[str, Any], seed: int, device: str) -> Task:
    module = build(card).to(device)
    if isinstance(module, Field):
        return FieldTask(module, material, preset.augmentation, seed, preset.batch, preset.queries, preset.queries)
    assert isinstance(module, PooledFill)
    return FillTask(module, material, preset.augmentation, seed, preset.batch, preset.queries)


def _threshold(field: Field, material: Material, category: str) -> float:
    of_category = [one for one in material.held_out if one.shape.record.category == category]
    chosen = _evenly(of_category, THRESHOLD_VIEWS)
    views = [example(one, material.predictions(one) if material.predictions else None) for one in chosen]
    return choose_threshold(field, views, np.random.default_rng(0))


def _evenly(found: list[Observation], number: int) -> list[Observation]:
    return [found[k] for k in np.linspace(0, len(found) - 1, min(number, len(found))).round().astype(int)]
