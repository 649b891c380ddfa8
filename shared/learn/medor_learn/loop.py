"""The training loop: AdamW, warm-up and cosine decay, checkpoints, best weights. One loop for every network."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from medor_learn import weights
from medor_learn.interrupt import asked_to_stop
from medor_learn.progress import TrainingProgress
from medor_learn.run import Run, Task
from medor_learn.schedule import Schedule

__all__ = ["Schedule", "Task", "train"]

Scalars = Callable[[dict[str, float], int], None]


def train(
    task: Task,
    out: Path,
    schedule: Schedule,
    *,
    card: dict[str, Any],
    start: Path | None = None,
    tensorboard: bool = False,
    on_step: Callable[[int, float], None] | None = None,
) -> dict[str, Any]:
    """Learn a task, or go on where its folder's checkpoint stands.

    Args:
        task: with a module on the device to train on, initialised.
        out: folder of the run: `checkpoint.pt`, `log.jsonl`, and the best weights in `best`.
        schedule: how long and how fast.
        card: JSON that describes the network and its data, all that is needed to build it; becomes the weights' config
            together with step, metrics, schedule and revision. Must be the same when a run goes on.
        start: folder of weights to begin with, of an earlier run on other data for instance; the card then says so.
        tensorboard: write the metrics for TensorBoard, too.
        on_step: called with the number of steps done and the loss of the last.

    Returns:
        `step`, `hours`, `best` (metrics), `best_step` and `ended`: finished, patience or interrupted.

    Raises:
        ResumeError: the folder holds a run of another card or schedule.
        WeightsError: `start` holds weights of another network.
        Diverged: the loss is not finite; the last checkpoint stays.
    """
    if start:
        card = card | {"start": weights.start(task.module, start)}
    card = json.loads(json.dumps(card))
    out.mkdir(parents=True, exist_ok=True)
    with _threads(schedule.threads), asked_to_stop() as stop:
        run = Run(task, out, schedule, card)
        with TrainingProgress(run.done) as progress, _scalars(out, tensorboard) as write_scalars:
            ended = _learn(run, stop, progress, write_scalars, on_step)
    standing = run.standing
    summary = {name: getattr(standing, name) for name in ("step", "hours", "best", "best_step")}
    return summary | {"ended": ended}


def _learn(
    run: Run,
    stop: Callable[[], bool],
    progress: TrainingProgress,
    write_scalars: Scalars,
    on_step: Callable[[int, float], None] | None,
) -> str:
    """Step by step to an end, and why it is one."""
    schedule, standing = run.schedule, run.standing
    ended, saved = "finished", time.monotonic()
    while run.done < 1 and ended == "finished":
        loss = run.step()
        progress.update(standing.step, run.done, loss)
        if on_step:
            on_step(standing.step, loss)
        if standing.step % schedule.validate_every == 0:
            run.report(progress, write_scalars)
        if stop():
            ended = "interrupted"
        elif schedule.patience is not None and standing.stale >= schedule.patience:
            ended = "patience"
        elif time.monotonic() - saved > schedule.checkpoint_s:
            run.save()
            saved = time.monotonic()
    if ended == "finished" and standing.validated != standing.step:
        run.report(progress, write_scalars)
    run.save()
    return ended


@contextmanager
def _threads(number: int) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(number)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def _scalars(out: Path, tensorboard: bool) -> Iterator[Scalars]:
    """A function that takes metrics of a step; it does nothing without TensorBoard."""
    if not tensorboard:
        yield lambda entry, step: None
        return
    from torch.utils.tensorboard import SummaryWriter  # an extra: medor-learn[tensorboard]

    def write(entry: dict[str, float], step: int) -> None:
        for name, value in entry.items():
            writer.add_scalar(name, value, step)

    with SummaryWriter(str(out / "tensorboard")) as writer:
        yield write
