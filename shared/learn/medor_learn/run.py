"""What a training run consists of: a task, its optimizer, and where they stand."""

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from medor_learn import checkpoint, weights
from medor_learn.checkpoint import Standing
from medor_learn.errors import Diverged
from medor_learn.precision import has_bf16
from medor_learn.progress import TrainingProgress
from medor_learn.revision import revision
from medor_learn.schedule import Schedule

SCORE = "score"
"""The metric that is minimised."""


class Task(Protocol):
    """What is learnt."""

    @property
    def module(self) -> nn.Module:
        """The network, initialised, on the device to train on."""
        ...

    def loss(self, step: int) -> Tensor:
        """Scalar to minimise, of a batch drawn from (seed, step) alone. torch's own generator is seeded by the loop."""
        ...

    def validate(self) -> dict[str, float]:
        """Metrics on held-out data; the lowest `score` has the best weights."""
        ...


class Run:
    """A task, its optimizer and where they stand."""

    def __init__(self, task: Task, out: Path, schedule: Schedule, card: dict[str, Any]) -> None:
        self.task, self.out, self.schedule, self.card = task, out, schedule, card
        self.device = next(task.module.parameters()).device
        self.optimizer = torch.optim.AdamW(_groups(task.module, schedule.weight_decay), schedule.lr, fused=True)
        self.config = {"card": card, "schedule": schedule.lasting()}
        self.checkpoint, self.log = out / "checkpoint.pt", out / "log.jsonl"
        self.standing = Standing()
        if self.checkpoint.exists():
            self._resume()
        self._clock = time.process_time()

    @property
    def done(self) -> float:
        """Share of the run that is over."""
        return self.schedule.progress(self.standing.step, self.standing.hours)

    def step(self) -> float:
        """One step down; its loss."""
        standing, module = self.standing, self.task.module
        lr = self.schedule.learning_rate(standing.step, standing.hours)
        for group in self.optimizer.param_groups:
            group["lr"] = lr
        module.train()
        torch.manual_seed(int(np.random.SeedSequence((self.schedule.seed, standing.step)).generate_state(1)[0]))
        with self._autocast():
            loss = self.task.loss(standing.step)
        value = float(loss.detach())
        if not math.isfinite(value):
            raise Diverged(f"the loss of step {standing.step} is {value}; a lower learning rate than {lr:g} may help")
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(module.parameters(), self.schedule.clip)
        self.optimizer.step()
        standing.step += 1
        standing.losses.append(value)
        self._tick()
        return value

    def report(self, progress: TrainingProgress, write_scalars: Callable[[dict[str, float], int], None]) -> None:
        """Validate, log, and keep the weights if they are the best so far."""
        standing = self.standing
        metrics = self._validate()
        self._tick()
        entry = {
            "step": standing.step,
            "hours": round(standing.hours, 5),
            "lr": self.schedule.learning_rate(standing.step, standing.hours),
            "loss": float(np.mean(standing.losses)),
            **metrics,
        }
        with self.log.open("a") as log:
            log.write(json.dumps(entry) + "\n")
        write_scalars(entry, standing.step)
        progress.say("  ".join(f"{name} {value:.4g}" for name, value in entry.items()))
        standing.losses, standing.validated = [], standing.step
        standing.stale += 1
        if metrics[SCORE] < standing.best.get(SCORE, math.inf):
            standing.best, standing.best_step, standing.stale = metrics, standing.step, 0
            self._keep(entry)

    def save(self) -> None:
        """Write the checkpoint."""
        parts = {"module": self.task.module.state_dict(), "optimizer": self.optimizer.state_dict()}
        checkpoint.write(self.checkpoint, self.standing, self.config, **parts)

    def _validate(self) -> dict[str, float]:
        self.task.module.eval()
        with torch.no_grad(), self._autocast():
            return {name: float(value) for name, value in self.task.validate().items()}

    def _keep(self, entry: dict[str, float]) -> None:
        facts = {"metrics": entry, "schedule": asdict(self.schedule), "revision": revision()}
        weights.save(self.out / "best", self.task.module, self.card | facts, self.card | facts)

    def _resume(self) -> None:
        found = checkpoint.read(self.checkpoint, self.config)
        self.standing = found["standing"]
        self.task.module.load_state_dict(found["module"])
        self.optimizer.load_state_dict(found["optimizer"])
        self._forget_later_lines()

    def _forget_later_lines(self) -> None:
        """Lines logged after the checkpoint will be written again."""
        lines = self.log.read_text().splitlines(keepends=True) if self.log.exists() else []
        kept = [line for line in lines if line.endswith("\n") and json.loads(line)["step"] <= self.standing.step]
        partial = self.log.with_name(".log.partial")
        partial.write_text("".join(kept))
        partial.replace(self.log)

    def _autocast(self) -> torch.autocast:
        kind = self.device.type
        return torch.autocast(kind, dtype=torch.bfloat16, enabled=self.schedule.bf16 and has_bf16(kind))

    def _tick(self) -> None:
        now = time.process_time()
        self.standing.hours += (now - self._clock) / 3600
        self._clock = now


def _groups(module: nn.Module, weight_decay: float) -> list[dict[str, Any]]:
    """Parameters with and without weight decay."""
    learnt = [parameter for parameter in module.parameters() if parameter.requires_grad]
    matrices = [parameter for parameter in learnt if parameter.ndim > 1]
    vectors = [parameter for parameter in learnt if parameter.ndim <= 1]
    groups = ({"params": matrices, "weight_decay": weight_decay}, {"params": vectors, "weight_decay": 0.0})
    return [group for group in groups if group["params"]]
