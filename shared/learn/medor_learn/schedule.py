"""How long and how fast to learn."""

import math
from dataclasses import asdict, dataclass
from typing import Any

FINAL_SHARE = 0.01
"""Learning rate at the end, as a share of the highest."""
HOW_LONG = ("steps", "hours", "patience", "threads", "checkpoint_s")
"""What may change when a run goes on: when it ends and what it runs on, not what it learns from."""


@dataclass(frozen=True)
class Schedule:
    """Settings of a training run.

    Attributes:
        steps: after which training ends.
        hours: of CPU time, over all resumptions, after which training ends even if steps are left.
        lr: highest learning rate.
        warm_up: steps until it is reached.
        weight_decay: of matrices and kernels; biases and norms have none.
        clip: greatest norm of the gradient.
        bf16: run the network in bfloat16 where torch's autocast deems it safe and the device is fast at it.
        validate_every: steps between two looks at held-out data.
        checkpoint_s: seconds between two checkpoints.
        patience: validations without a better score after which training ends; None for never.
        seed: of all that is drawn at random.
        threads: of the CPU.
    """

    steps: int = 20_000
    hours: float | None = None
    lr: float = 1e-3
    warm_up: int = 200
    weight_decay: float = 0.0
    clip: float = 1.0
    bf16: bool = False
    validate_every: int = 500
    checkpoint_s: float = 120.0
    patience: int | None = None
    seed: int = 0
    threads: int = 1

    def progress(self, step: int, hours: float) -> float:
        """Share of the run that is over, by whichever limit is nearer."""
        return min(1.0, max(step / self.steps, hours / self.hours if self.hours else 0.0))

    def learning_rate(self, step: int, hours: float) -> float:
        """Linear warm-up, then half a cosine down to a hundredth."""
        decay = (1 + math.cos(math.pi * self.progress(step, hours))) / 2
        return self.lr * min(1.0, (step + 1) / max(self.warm_up, 1)) * (FINAL_SHARE + (1 - FINAL_SHARE) * decay)

    def lasting(self) -> dict[str, Any]:
        """The settings that must stay the same when a run goes on."""
        return {name: value for name, value in asdict(self).items() if name not in HOW_LONG}
