"""What a data set will hold. The same plan gives the same data on any machine, in any number of shards."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from medor_cloth.dataset import SPLITS, box_of
from medor_cloth.errors import GarmentError
from medor_cloth.garment import CATEGORIES, GENERATOR_VERSION, Garment, generate

Kind = Literal["recon", "dynamics"]
KINDS: tuple[Kind, ...] = ("recon", "dynamics")
_GARMENT, _START, _TRAJECTORY = range(3)
"""What a random stream is for."""


@dataclass(frozen=True)
class Plan:
    """Everything the data depends on but the code: recorded in every shard.

    Attributes:
        kind: `recon` or `dynamics`.
        category: One of the garment categories.
        n: Trajectories, over all shards.
        seed: Another seed, other garments and other chances.
        split: Whether the garments are for training or for tests.
        per_garment: Trajectories of each garment.
        edge_m: Mean edge length of the meshes [m].
        winding: Nodes along each side of the stored winding-number grids; 0 for none.
    """

    kind: Kind
    category: str
    n: int
    seed: int = 0
    split: Literal["train", "test"] = "train"
    per_garment: int = 10
    edge_m: float = 0.012
    winding: int = 0

    @property
    def garments(self) -> int:
        """How many garments there are, over all shards."""
        return -(-self.n // self.per_garment)

    def shard(self, index: int, count: int) -> range:
        """The garments of one of `count` shards."""
        return range(index, self.garments, count)

    def trajectories(self, garment: int) -> range:
        """Ids of a garment's trajectories."""
        first = garment * self.per_garment
        return range(first, min(first + self.per_garment, self.n))

    def make_garment(self, garment: int) -> Garment:
        """The garment of a number: the first that can be made of those its random stream names."""
        rng = self._rng(_GARMENT, garment)
        seeds = SPLITS[self.split]
        while True:
            try:
                return generate(self.category, int(rng.integers(seeds.start, seeds.stop)), self.edge_m)
            except GarmentError:
                continue

    def start_rng(self, start: int, attempt: int) -> np.random.Generator:
        """Chance of a start state that several trajectories share."""
        return self._rng(_START, start, attempt)

    def trajectory_rng(self, trajectory: int, attempt: int) -> np.random.Generator:
        """Chance of a trajectory; of a new one whenever the last was discarded."""
        return self._rng(_TRAJECTORY, trajectory, attempt)

    def record(self) -> dict[str, Any]:
        """The plan as a shard's attributes hold it."""
        return asdict(self) | {"nocs_box": box_of(self.category), "generator": GENERATOR_VERSION}

    def _rng(self, *purpose: int) -> np.random.Generator:
        names = [KINDS.index(self.kind), CATEGORIES.index(self.category), list(SPLITS).index(self.split)]
        return np.random.default_rng([self.seed, *names, *purpose])
