"""How far from the truth rollouts end: `python -m medor_dynamics.evaluate --weights DIR --test DIR`."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from medor_cloth.dataset import Dataset, GarmentRecord
from medor_cloth.picker import GLANCE_FRAMES
from medor_cloth.picture import png_bytes
from medor_cloth.solver import SolverConfig
from medor_dynamics.coarse import Coarse
from medor_dynamics.learned import Learned
from medor_dynamics.model import Dynamics, Predictor
from medor_dynamics.physics import Physics, without_layers
from medor_dynamics.preset import PULL_STEPS, STEPS
from medor_dynamics.replay import replay_errors
from medor_dynamics.samples import Recording, recordings_of, stretches
from medor_dynamics.sheet import sheet
from medor_dynamics.shipped import DEFAULT, load

TOGETHER = 8
"""Recordings rolled out in one batch."""


@torch.inference_mode()
def rollout_errors(
    model: Dynamics, recordings: Sequence[Recording], dtype: torch.dtype = torch.float32
) -> NDArray[np.float64]:
    """(R, 16) distance of the nodes from where they were recorded, mean over nodes, after each step [m]."""
    predictor = model.predictor(dtype)
    errors = [rolled for few in in_parts(recordings) for rolled in errors_of(predictor, few, model.device)]
    return np.array(errors)


def errors_of(predictor: Predictor, recordings: Sequence[Recording], device: torch.device) -> NDArray[np.float64]:
    """`rollout_errors` of a few recordings at once."""
    starts = [0] * len(recordings)
    batch = stretches(recordings, starts, [each.before(0) for each in recordings], STEPS).to(device)
    motion, errors = batch.motion, []
    for grip, target in zip(batch.grips, batch.targets, strict=True):
        motion = predictor(batch.graphs, motion, grip)
        distance = (motion.positions - target).norm(dim=1).cpu().numpy()
        errors.append(np.add.reduceat(distance, batch.graphs.starts[:-1]) / np.diff(batch.graphs.starts))
    return np.array(errors).T


def in_parts(recordings: Sequence[Recording]) -> Iterator[Sequence[Recording]]:
    for start in range(0, len(recordings), TOGETHER):
        yield recordings[start : start + TOGETHER]


def motionless_errors(recordings: Sequence[Recording]) -> NDArray[np.float64]:
    """(R, 16) errors [m] of predicting that nothing moves."""
    return np.array([distances(each, np.zeros((STEPS, 1, 3))) for each in recordings])


def rigid_errors(recordings: Sequence[Recording]) -> NDArray[np.float64]:
    """(R, 16) errors [m] of predicting that the cloth glides along under the picker as if it were rigid."""
    steps = np.minimum(np.arange(1, STEPS + 1), PULL_STEPS)[:, None, None]
    return np.array([distances(each, steps * each.step * np.array([1, 1, 0])) for each in recordings])


def distances(recording: Recording, displacement: NDArray) -> NDArray[np.float64]:
    """(16,) mean distance [m] of the recorded positions from the first ones displaced by (16, 1, 3)."""
    offset = recording.positions[1:] - recording.positions[0] - displacement
    return np.linalg.norm(offset, axis=-1).mean(axis=1)


@dataclass(frozen=True)
class Options:
    """What to measure."""

    test: Path
    """Data set of held-out garments."""
    weights: Path = DEFAULT
    visible_only: bool = False
    """Show the model what the camera sees of the cloth, nothing else."""
    at_most: int = 200
    """Recordings per category."""
    picture: Path | None = None
    """PNG of a few pulls: before, recorded, foreseen by the model and by the coarse solver."""
    pictured: int = 2
    """Pulls in the picture, of each category."""


def main(options: Options) -> None:
    torch.set_num_threads(1)
    model, dataset = load(options.weights), Dataset(options.test)
    rough = without_layers(SolverConfig())
    solvers = {
        "whole": Physics(1, settle_frames=GLANCE_FRAMES),
        "without layers": Physics(1, config=rough, settle_frames=GLANCE_FRAMES),
        "coarse": Coarse(1),
    }
    table = Table("category", "pulls", "model", "no motion", "rigid", *(f"solver, {name}" for name in solvers))
    table.title = "mean error of the nodes after 16 steps [mm]"
    by_category: dict[str, list[GarmentRecord]] = defaultdict(list)
    for record in dataset.garments:
        by_category[record.category].append(record)
    for category, records in by_category.items():
        every = (recordings_of(record, model.preset, options.visible_only) for record in records)
        some = list(islice(chain.from_iterable(every), options.at_most))
        learned = (rollout_errors(model, some), motionless_errors(some), rigid_errors(some))
        replayed = (islice(replay_errors(solver, records), options.at_most) for solver in solvers.values())
        means = [*(errors[:, -1].mean() for errors in learned), *(np.mean(list(errors)) for errors in replayed)]
        table.add_row(category, str(len(some)), *(f"{1e3 * mean:.1f}" for mean in means))
    Console().print(table)
    if options.picture:
        few = (record for records in by_category.values() for record in records[: options.pictured])
        shown = [pull for record in few for pull in record.trajectories()[:1]]
        backends = {"learned": Learned(model.predictor(), 1), "coarse solver": solvers["coarse"]}
        options.picture.write_bytes(png_bytes(sheet(shown, backends)))


if __name__ == "__main__":
    main(tyro.cli(Options))
