"""Learning the residual of the fill (`medor_learn.loop.Task`)."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from medor_recon.completion.augment import Augmentation, Example, varied
from medor_recon.completion.field import LENGTH_M
from medor_recon.completion.fill import FillInputs, PooledFill, fill_inputs
from medor_recon.completion.frame import garment_frame
from medor_recon.completion.material import Material
from medor_recon.completion.measures import canonical_of, warp_errors
from medor_recon.completion.observations import CAMERA

JITTER_M = 0.004
"""Spread of the canonical points about the garment's vertices: a template is another garment."""
ROUGH = 0.1
"""Errors below this [in LENGTH_M] count squared, larger ones linearly: a few points lie far off."""


@dataclass
class FillTask:
    """One batch of views a step, some vertices of each."""

    module: PooledFill
    material: Material
    augmentation: Augmentation
    seed: int = 0
    batch: int = 8
    vertices: int = 512

    def loss(self, step: int) -> Tensor:
        rng = np.random.default_rng([self.seed, step])
        items = [
            varied(*self.material.draw(self.augmentation.predicted, rng), self.augmentation, rng)
            for _ in range(self.batch)
        ]
        drawn = [self._points(item, rng) for item in items]
        filled = self.module(*_stacked([inputs for inputs, _ in drawn], next(self.module.parameters()).device))
        targets = torch.from_numpy(np.stack([target for _, target in drawn])).to(filled.device)
        return F.smooth_l1_loss(filled / LENGTH_M, targets / LENGTH_M, beta=ROUGH)

    def validate(self) -> dict[str, float]:
        return self.material.validate(lambda items: warp_errors(self.module.positions, items, CAMERA), "error_cm")

    def _points(self, item: Example, rng: np.random.Generator) -> tuple[FillInputs, np.ndarray]:
        chosen = rng.integers(len(item.nocs), size=self.vertices)
        canonical = canonical_of(item)[chosen] + rng.normal(0, JITTER_M, (self.vertices, 3))
        frame = garment_frame(item.pixels)
        inputs = fill_inputs(frame.view(item.pixels), canonical, self.module.config, self.module.categories)
        return inputs, frame.inward(item.positions[chosen])


def _stacked(inputs: list[FillInputs], device: torch.device) -> tuple[Tensor, ...]:
    parts = [(one.summary, one.points, one.filled) for one in inputs]
    return tuple(torch.from_numpy(np.stack(part)).to(device) for part in zip(*parts, strict=True))
