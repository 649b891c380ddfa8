"""A glance: what pulls will bring, at the first sight of the garment, before any model is heard.

A convolutional network over the patches of each pull and what else is known of it, learnt by
`medor_planner.judge.train_glance` from what pulls truly brought. A pull and its mirror image bring the same: it looks
at both. The best of many pulls is often one that somebody is wrong about, so where its words differ it promises less.
"""

from pathlib import Path
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from medor_learn import weights
from medor_learn.errors import WeightsError
from medor_planner.judge.features import features, mirrored
from medor_planner.judge.judge import LIMIT, SHIPPED
from medor_planner.judge.patches import NEAR, NEAR_CELLS, WIDE, WIDE_CELLS, Maps, Patches
from medor_planner.judge.situation import Situation
from medor_wire.errors import BadRequest

FOLDER = "glance"
WIDTHS = (16, 32, 48, 64)
"""Maps after each layer of a tower."""
SAID = 96
"""What a tower says of its patch."""
HIDDEN = 128
TOWER_DROPOUT, DROPOUT = 0.2, 0.3
MEMBERS = 3
"""Networks that look at the same."""
CAUTION = 1.0
"""Standard deviations of their words that are taken off the mean."""
UNIT = (0.05, 0.008)
"""Typical gains: share of the flat coverage, metres of canonical cost."""
BATCH = 100
"""Pulls looked at together."""


class Tower(nn.Sequential):
    """Maps (N, C, cells, cells) to (N, SAID): every layer halves their sides; where things are is kept to the end."""

    def __init__(self, maps: int, cells: int) -> None:
        layers: list[nn.Module] = []
        for before, after in zip((maps, *WIDTHS), WIDTHS, strict=False):
            layers += [nn.Conv2d(before, after, 3, stride=2, padding=1), nn.BatchNorm2d(after), nn.SiLU()]
        last = WIDTHS[-1] * (cells // 2 ** len(WIDTHS)) ** 2
        super().__init__(*layers, nn.Flatten(), nn.Dropout(TOWER_DROPOUT), nn.Linear(last, SAID), nn.SiLU())


class Member(nn.Module):
    """One network: patches and normalised features (N, F) to gains (N, 2) in units."""

    def __init__(self, features: int) -> None:
        super().__init__()
        self.near, self.wide = Tower(len(NEAR), NEAR_CELLS), Tower(len(WIDE), WIDE_CELLS)
        self.known = nn.Sequential(nn.Linear(features, HIDDEN), nn.SiLU())
        self.head = nn.Sequential(
            nn.Dropout(DROPOUT),
            nn.Linear(2 * SAID + HIDDEN, HIDDEN), nn.SiLU(), nn.Dropout(DROPOUT),
            nn.Linear(HIDDEN, len(UNIT)),
        )  # fmt: skip

    def forward(self, near: Tensor, wide: Tensor, known: Tensor) -> Tensor:
        return self.head(torch.cat([self.near(near), self.wide(wide), self.known(known)], dim=1))


class GlanceNet(nn.Module):
    """A few networks that look at the same, and what normalises it.

    Args:
        features: F, how many.
    """

    mean: Tensor
    scale: Tensor
    unit: Tensor

    def __init__(self, features: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))
        self.register_buffer("unit", torch.tensor(UNIT))
        self.members = nn.ModuleList(Member(features) for _ in range(MEMBERS))

    def forward(self, near: Tensor, wide: Tensor, values: Tensor) -> Tensor:
        """(M, N, 2) gains in units, as each member expects them, of patches (N, 2, 64, 64), (N, 7, 48, 48) and features
        (N, F)."""
        known = ((values - self.mean) / self.scale).clamp(-LIMIT, LIMIT)
        return torch.stack([member(near, wide, known) for member in self.members])

    @torch.inference_mode()
    def words(self, patches: Patches, names: tuple[str, ...], values: NDArray[np.float32]) -> NDArray[np.float32]:
        """(W, K, 2) share of the flat coverage, metres of canonical cost: what every member says, and in a mirror."""
        both = ((patches, values), (patches.mirrored, values[:, mirrored(names)]))
        return (torch.cat([self._said(*one) for one in both]) * self.unit).numpy()

    def _said(self, patches: Patches, values: NDArray[np.float32]) -> Tensor:
        parts = [slice(start, start + BATCH) for start in range(0, len(values), BATCH)]
        arrays = (patches.near, patches.wide, values)
        return torch.cat([self(*(torch.from_numpy(it[part]).float() for it in arrays)) for part in parts], dim=1)


def promised(words: NDArray[np.float32]) -> NDArray[np.float32]:
    """(K, 2) what words (W, K, 2) can be relied on for."""
    return words.mean(axis=0) - CAUTION * words.std(axis=0)


class Glance:
    """A trained network, with the names of the features that it was taught with."""

    def __init__(self, network: GlanceNet, names: tuple[str, ...]) -> None:
        self._network, self._names = network.eval(), names

    @classmethod
    def load(cls, root: Path = SHIPPED) -> Self:
        """From the folder of the judges' weights.

        Raises:
            BadRequest: there are none in it, or of another network.
        """
        try:
            names = tuple(weights.read_config(root / FOLDER)["features"])
            network = GlanceNet(len(names))
            weights.start(network, root / FOLDER)
        except (WeightsError, KeyError) as error:
            raise BadRequest(
                f"no weights of a glance in {root.name}/{FOLDER}/ ({error}); they are trained by "
                "`python -m medor_planner.judge.train_glance --data <folder> --out <folder>`"
            ) from error
        return cls(network, names)

    def gains(self, situation: Situation) -> NDArray[np.float32]:
        """(K, 2) what the candidates promise to bring: share of the flat coverage, metres of canonical cost.

        Raises:
            BadRequest: taught with other features.
            NoGarment: no pixel of the view shows cloth.
        """
        names, values = features(situation.heard([]))
        if names != self._names:
            raise BadRequest("the glance's weights were taught with other features; train them anew")
        return promised(self._network.words(Maps.of(situation).around(situation.candidates), names, values))
