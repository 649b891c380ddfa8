"""What a canonicalisation network learns, and how it is judged while it does."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from medor_recon.canonical import augment, symmetry
from medor_recon.canonical.batches import Batch, draw
from medor_recon.canonical.head import decode
from medor_recon.canonical.measures import Judgement, summary
from medor_recon.canonical.network import Prediction
from medor_recon.canonical.preset import Preset
from medor_recon.canonical.views import Views

VALIDATION_SEED = 0
"""Of the pixels that are looked at; the same at every validation."""


@dataclass(eq=False)
class CanonicalTask:
    """A task for `medor_learn.loop.train`.

    Attributes:
        module: the network, on its device.
        preset: it was built from.
        views: to learn from.
        held_out: views of other garments, with the same categories.
        seed: of batches and augmentation.
        validated: views of each category that are looked at in a validation, evenly spread.
    """

    module: nn.Module
    preset: Preset
    views: Views
    held_out: Views
    seed: int = 0
    validated: int = 250

    def __post_init__(self) -> None:
        self.augmentation = augment.Augmentation() if self.preset.rough else augment.TURNS
        self.device = next(self.module.parameters()).device
        self._order = lru_cache(maxsize=2)(self._shuffled)

    def loss(self, step: int) -> Tensor:
        """Cross-entropy of the coordinates, and a little of that of the side."""
        rng = np.random.default_rng((self.seed, 1, step))
        batch = draw(self.views, self.rows(step), self.preset, self.augmentation, rng).to(self.device)
        return self.loss_of(batch)

    def loss_of(self, batch: Batch) -> Tensor:
        """Loss of a batch, averaged over its views."""
        said = self.module(*batch.seen, batch.category)
        total = torch.zeros((), device=self.device)
        for number in batch.category.unique().tolist():
            mine = torch.nonzero(batch.category == number)[:, 0]
            total = total + self._loss_of_category(said, batch.nocs, mine, self.views.categories[number])
        return total / len(batch.category)

    def rows(self, step: int) -> NDArray[np.int64]:
        """The views of a step: every view once in an epoch, in an order of its own."""
        count, size = len(self.views), self.preset.batch
        epochs, places = np.divmod(np.arange(step * size, (step + 1) * size), count)
        return np.array([self._order(int(epoch))[place] for epoch, place in zip(epochs, places, strict=True)])

    def validate(self) -> dict[str, float]:
        """Errors on held-out garments; the score is the mean symmetry-aware error, averaged over categories."""
        judged = {category: self._judge(category) for category in self.held_out.categories}
        metrics = {f"{category}/{name}": value for category, j in judged.items() for name, value in summary(j).items()}
        return {"score": float(np.mean([metrics[f"{category}/aware"] for category in judged]))} | metrics

    def _loss_of_category(self, said: Prediction, nocs: Tensor, mine: Tensor, category: str) -> Tensor:
        matrices = symmetry.rotations(category, self.device)
        matrices = matrices if self.preset.symmetric else matrices[:1]
        loss, turn = symmetry.cross_entropy(said.logits[mine], nocs[mine], matrices)
        total = loss.sum()
        if self.preset.side and symmetry.sides(category) > 1:
            total = total + self.preset.side * F.cross_entropy(said.side[mine].float(), turn, reduction="sum")
        return total

    def _judge(self, category: str) -> Judgement:
        rows = self.held_out.of(category)
        rows = rows[np.linspace(0, len(rows) - 1, min(self.validated, len(rows))).round().astype(int)]
        rng = np.random.default_rng(VALIDATION_SEED)
        parts = np.array_split(rows, -(-len(rows) // self.preset.batch))
        return Judgement.joined([self._judge_batch(part, category, rng) for part in parts])

    def _judge_batch(self, rows: NDArray[np.int64], category: str, rng: np.random.Generator) -> Judgement:
        batch = draw(self.held_out, rows, self.preset, augment.NONE, rng).to(self.device)
        said = self.module(*batch.seen, batch.category)
        nocs, _ = decode(said.logits)
        return Judgement.of(category, nocs, batch.nocs, said.side)

    def _shuffled(self, epoch: int) -> NDArray[np.int64]:
        return np.random.default_rng((self.seed, 0, epoch)).permutation(len(self.views))
