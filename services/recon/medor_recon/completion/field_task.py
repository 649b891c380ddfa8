"""Learning the winding-number field and the warp field (`medor_learn.loop.Task`)."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from medor_cloth.nocs import NOCS
from medor_recon.completion.augment import Augmentation, Example, varied
from medor_recon.completion.field import Field
from medor_recon.completion.material import Material
from medor_recon.completion.measures import warp_errors
from medor_recon.completion.observations import CAMERA, Observation
from medor_recon.completion.queries import SURFACE, VOLUME, Queries, queries


@dataclass
class FieldTask:
    """Squared errors of both fields (MEDOR, section III-B)."""

    module: Field
    material: Material
    augmentation: Augmentation
    seed: int = 0
    batch: int = 2
    volume_queries: int = VOLUME
    surface_queries: int = SURFACE

    def loss(self, step: int) -> Tensor:
        rng = np.random.default_rng([self.seed, step])
        drawn = [self.material.draw(self.augmentation.predicted, rng) for _ in range(self.batch)]
        items = [varied(*pair, self.augmentation, rng) for pair in drawn]
        asked = [self._queries(pair[0], item, rng) for pair, item in zip(drawn, items, strict=True)]
        winding, position = self._errors(items, asked)
        return winding + self.module.config.position_weight * position

    def validate(self) -> dict[str, float]:
        return self.material.validate(self._measure, "objective")

    def _measure(self, items: list[Example]) -> dict[str, float]:
        """Both errors on the same queries each time, and the vertices' positions."""
        rng = np.random.default_rng(self.seed)
        errors = [
            self._errors([item], [self._queries(one, item, rng)])
            for one, item in zip(self.material.looked_at, items, strict=True)
        ]
        winding, position = torch.tensor(errors).mean(dim=0).tolist()
        objective = winding + self.module.config.position_weight * position
        measures = {"winding_mse": winding, "position_mse": position, "objective": objective}
        return measures | warp_errors(self.module.warp, items, CAMERA)

    def _queries(self, observation: Observation, item: Example, rng: np.random.Generator) -> Queries:
        return queries(item, observation.shape.winding, rng, self.volume_queries, self.surface_queries)

    def _errors(self, items: list[Example], asked: list[Queries]) -> tuple[Tensor, Tensor]:
        """Mean squared errors of winding number and position, the latter a coordinate [m²]."""
        field = self.module
        frames = [field.frame(item.pixels) for item in items]
        volume = field.volume([frame.view(item.pixels) for frame, item in zip(frames, items, strict=True)])

        def stacked(parts: Iterable[np.ndarray]) -> Tensor:
            return torch.from_numpy(np.stack(list(parts))).to(volume.device)

        surface = [NOCS[item.pixels.category].decode(one.surface) for item, one in zip(items, asked, strict=True)]
        true = stacked(frame.inward(one.positions) for frame, one in zip(frames, asked, strict=True))
        winding = field.winding(volume, stacked(one.volume for one in asked))
        positions = field.positions(volume, stacked(one.surface for one in asked), stacked(surface))
        return F.mse_loss(winding, stacked(one.winding for one in asked)), F.mse_loss(positions, true)
