"""How far predicted canonical coordinates are from the true ones."""

from dataclasses import dataclass

import torch
from torch import Tensor

from medor_cloth.nocs import NOCS
from medor_recon.canonical.symmetry import rotations, sides, turned

NEAR, FAIR = 0.05, 0.1
"""Errors, as shares of the cube's side, that count as near and as fair."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """Errors of V views of N pixels, in sides of the NOCS cube.

    Attributes:
        category: of the garments.
        aware: (V, N) from the garment turned as fits a view best.
        plain: (V, N) from the garment as it is, of the prediction turned to the side that is thought to be right.
        right: (V,) bool, that side was the one that fits.
        sure: (V,) probability it was given.
    """

    category: str
    aware: Tensor
    plain: Tensor
    right: Tensor
    sure: Tensor

    @classmethod
    def of(cls, category: str, predicted: Tensor, true: Tensor, side: Tensor) -> "Judgement":
        """Judge a batch.

        Args:
            category: of all its views.
            predicted: (B, N, 3) coordinates.
            true: (B, N, 3) coordinates.
            side: (B, 2) logits; of no meaning for categories that have but one side.
        """
        matrices = rotations(category, predicted.device)
        errors = (predicted - turned(true, matrices)).norm(dim=-1)  # (K, B, N)
        turn = errors.mean(-1).argmin(0)
        views = torch.arange(len(turn), device=turn.device)
        sure, chosen = side.float().softmax(-1).max(-1)
        if sides(category) == 1:
            sure, chosen = torch.ones_like(sure), torch.zeros_like(chosen)
        plain = (turned(predicted, matrices)[chosen, views] - true).norm(dim=-1)
        right = chosen == turn if sides(category) > 1 else torch.ones_like(turn, dtype=torch.bool)
        return cls(category, errors[turn, views], plain, right, sure)

    @classmethod
    def joined(cls, parts: "list[Judgement]") -> "Judgement":
        """All views of some judgements of one category."""
        names = ("aware", "plain", "right", "sure")
        return cls(parts[0].category, *(torch.cat([getattr(part, name) for part in parts]) for name in names))


def summary(judgement: Judgement) -> dict[str, float]:
    """Means, medians and shares; `_cm` in canonical space, the others in sides of the cube."""
    aware, plain = judgement.aware.double(), judgement.plain.double()
    values = {
        "aware": aware.mean(),
        "aware_median": aware.median(),
        "aware_cm": aware.mean() * NOCS[judgement.category].side * 100,
        "aware_median_cm": aware.median() * NOCS[judgement.category].side * 100,
        "aware_near": (aware < NEAR).double().mean(),
        "aware_fair": (aware < FAIR).double().mean(),
        "plain": plain.mean(),
        "plain_median": plain.median(),
    }
    if sides(judgement.category) > 1:
        values |= {"side_right": judgement.right.double().mean(), "side_sure": judgement.sure.double().mean()}
    return {name: float(value) for name, value in values.items()}
