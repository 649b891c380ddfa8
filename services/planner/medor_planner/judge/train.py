"""Teach the judge: `python -m medor_planner.judge.train --data data/judge --out runs/judge`.

A minute or two on one core. First every garment is judged by networks that have not seen it (cross-validation over
garments): how well they rank, and what their favourite among a state's candidates brings, beside each model's
favourite. Then networks are taught on all garments and written.
"""

import sys
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from torch import Tensor, nn

from medor_learn import weights
from medor_learn.revision import revision
from medor_planner.judge.glance import UNIT
from medor_planner.judge.judge import FOLDER, LIMIT, TASKS
from medor_planner.judge.lessons import Lessons
from medor_planner.judge.merit import compared, table
from medor_planner.judge.opinions import OPINIONS
from medor_planner.judge.situation import DECISIONS


@dataclass(frozen=True)
class Options:
    """How to learn."""

    data: Path
    """Folder that `medor_planner.judge.collect` filled."""
    out: Path
    members: int = 6
    """Networks that are averaged."""
    hidden: int = 64
    epochs: int = 20
    batch: int = 128
    lr: float = 2e-3
    decay: float = 0.1
    dropout: float = 0.3
    noise: float = 0.05
    """On the features, in standard deviations."""
    folds: int = 4
    """Of the cross-validation; 0: none."""
    seed: int = 0
    start: Path | None = None
    """Folder of weights with a judge to go on from, with a smaller `--lr`; its merit is told beside the new one's."""


class Ensemble(nn.Module):
    """The networks, with what normalises their features; named as `judge.Judge` reads them."""

    mean: Tensor
    scale: Tensor
    unit: Tensor

    def __init__(self, features: int, options: Options) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))
        self.register_buffer("unit", torch.tensor(UNIT))
        hidden, drop = options.hidden, options.dropout
        self.members = nn.ModuleList(
            nn.Sequential(
                nn.Linear(features, hidden), nn.SiLU(), nn.Dropout(drop),
                nn.Linear(hidden, hidden), nn.SiLU(), nn.Dropout(drop),
                nn.Linear(hidden, len(TASKS)),
            )
            for _ in range(options.members)
        )  # fmt: skip

    def normalized(self, values: Tensor) -> Tensor:
        return ((values - self.mean) / self.scale).clamp(-LIMIT, LIMIT)

    def forward(self, values: Tensor) -> Tensor:
        """(N, 2) expected gains of features (N, F)."""
        inputs = self.normalized(values)
        return torch.stack([member(inputs) for member in self.members]).mean(0) * self.unit


def taught(
    values: NDArray[np.float32], gains: NDArray[np.float32], options: Options, before: Ensemble | None = None
) -> Ensemble:
    """Networks that have learnt from candidates (N, F) and what they brought (N, 2), on top of what others know."""
    torch.manual_seed(options.seed)
    if before is None:
        ensemble = Ensemble(values.shape[1], options)
        ensemble.mean.copy_(torch.from_numpy(values.mean(axis=0)))
        ensemble.scale.copy_(torch.from_numpy(values.std(axis=0) + 1e-6))
    else:
        ensemble = deepcopy(before).train()
    inputs, targets = ensemble.normalized(torch.from_numpy(values)), torch.from_numpy(gains) / ensemble.unit
    for member in ensemble.members:
        _teach(member, inputs, targets, options)
    return ensemble.eval()


def _teach(member: nn.Module, inputs: Tensor, targets: Tensor, options: Options) -> None:
    batches = max(len(inputs) // options.batch, 1)
    optimizer = torch.optim.AdamW(member.parameters(), lr=options.lr, weight_decay=options.decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, options.lr, total_steps=options.epochs * batches)
    for _ in range(options.epochs):
        for rows in torch.randperm(len(inputs))[: batches * options.batch].view(batches, -1):
            noisy = inputs[rows] + options.noise * torch.randn(len(rows), inputs.shape[1])
            loss = nn.functional.smooth_l1_loss(member(noisy), targets[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()


def earlier(data: Lessons, options: Options) -> tuple[Ensemble | None, dict[str, Any]]:
    """The judge to go on from and how it came about.

    Raises:
        SystemExit: it was taught with other features.
        WeightsError: its weights cannot be read, or are of another shape.
    """
    if options.start is None:
        return None, {}
    ensemble, folder = Ensemble(len(data.names), options), options.start / FOLDER
    if tuple(weights.read_config(folder)["features"]) != data.names:
        raise SystemExit(f"{folder}: was taught with other features than the models give today")
    history = weights.start(ensemble, folder)
    return ensemble.eval(), history


def said(ensemble: Ensemble, values: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, 2) expected gains of candidates with features (N, F)."""
    with torch.no_grad():
        return ensemble(torch.from_numpy(values)).numpy()


def judged_unseen(data: Lessons, options: Options, before: Ensemble | None = None) -> NDArray[np.float32]:
    """(N, 2) expected gains of every garment's candidates, by networks taught on other garments."""
    fold = np.random.default_rng(options.seed).permutation(np.unique(data.garment))
    fold_of = dict(zip(fold.tolist(), (np.arange(len(fold)) % options.folds).tolist(), strict=True))
    part = np.array([fold_of[seed] for seed in data.garment.tolist()])
    found = np.empty_like(data.gains)
    for k in track(range(options.folds), "cross-validation", console=Console(stderr=True), transient=True):
        test = part == k
        found[test] = said(taught(data.values[~test], data.gains[~test], options, before), data.values[test])
    return found


def main(options: Options) -> None:
    torch.set_num_threads(1)
    paths = sorted((options.data / DECISIONS).glob("*.npz"))
    if not paths:
        raise SystemExit(f"{options.data}: no states; collect some with `python -m medor_planner.judge.collect`")
    data = Lessons.read(paths)
    before, history = earlier(data, options)
    metrics = {}
    if options.folds:
        expected = {"judge": judged_unseen(data, options, before)}
        if before is not None:
            expected["judge before"] = said(before, data.values)
        found = compared(data, expected)
        Console().print(table(found))
        metrics = {task: {name: asdict(one) for name, one in merits.items()} for task, merits in found.items()}
    write(taught(data.values, data.gains, options, before), data, metrics, options, history)
    states, garments = data.state[-1] + 1, len(np.unique(data.garment))
    sys.stdout.write(f"{options.out / FOLDER}: taught on {states} states of {garments} garments\n")


def write(
    ensemble: Ensemble,
    data: Lessons,
    metrics: Mapping[str, Any],
    options: Options,
    history: Mapping[str, Any] | None = None,
) -> None:
    """A folder that `Judge.load` reads."""
    schedule = {name: value for name, value in asdict(options).items() if not isinstance(value, Path | None)}
    config = {
        "opinions": [opinion.name for opinion in OPINIONS],
        "features": list(data.names),
        "members": options.members,
        "layers": sorted({int(name.split(".")[2]) for name in ensemble.state_dict() if name.startswith("members.")}),
        "data": {
            "states": int(data.state[-1]) + 1,
            "candidates": len(data.state),
            "garment_seeds": [int(data.garment.min()), int(data.garment.max())],
        },
        "schedule": schedule,
        "metrics": metrics,
        "revision": revision(),
        **({"start": history} if history else {}),
    }
    card = {
        "What it is": "Rates pick-and-place candidates: the gain in coverage and in closeness to the canonical pose to "
        f"expect of each, from what the camera sees, what the mesh believes and what models foresee: "
        f"{', '.join(opinion.name for opinion in OPINIONS)}.",
        "Data": config["data"],
        "Schedule": schedule,
        "Metrics": metrics,
        "Revision": str(config["revision"]),
        **({"It goes on from": history} if history else {}),
    }
    weights.save(options.out / FOLDER, ensemble, config, card)


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
