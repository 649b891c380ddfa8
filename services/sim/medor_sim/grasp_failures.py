"""Grasps that fail as real ones do (MEDOR, physical robot experiments): nothing is caught, or two layers at once."""

from dataclasses import dataclass, replace
from typing import Literal
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from medor_cloth.grasp import REACH_M
from medor_cloth.integration import FRAME_S
from medor_cloth.solver import ClothState

Grasp = Literal["good", "missed", "two layers"]
APART = 4
"""A vertex at least so many edges away from the held one is of another layer, if it is near all the same."""


@dataclass(frozen=True)
class GraspFailures:
    """How often grasps fail.

    Attributes:
        miss: Probability of catching nothing.
        two_layers: Probability that a grasp that catches takes the next layer along, where there is one in reach.
        seed: Of the chance.
    """

    miss: float = 0.0
    two_layers: float = 0.0
    seed: int = 0

    def draw(self, number: int, pick: NDArray, place: NDArray) -> Grasp:
        """How the grasp of an episode's action goes; the same action, number and seed always go alike."""
        action = crc32(np.concatenate([pick, place]).astype(np.float64).tobytes())
        first, second = np.random.default_rng([self.seed, number, action]).random(2)
        if first < self.miss:
            return "missed"
        return "two layers" if second < self.two_layers else "good"


class NextLayer:
    """Takes the next layer along: put, after each frame, where it was caught beside the held vertex.

    The cloth's engine holds one vertex exactly; this one falls for the length of a frame before it is put back.
    """

    def __init__(self, edges: NDArray[np.int32]) -> None:
        self._edges = edges
        self.vertex = -1
        self._beside = np.zeros(3, np.float32)

    def follow(self, frame: int, cloth: ClothState) -> ClothState:
        """The cloth with the second vertex beside the held one; as it is when nothing is held or near."""
        if cloth.held < 0:
            self.vertex = -1
            return cloth
        if self.vertex < 0:
            self.vertex = self._next(cloth)
            if self.vertex < 0:
                return cloth
            caught = cloth.positions[cloth.held] - FRAME_S * cloth.velocities[cloth.held]
            self._beside = cloth.positions[self.vertex] - caught
        positions, velocities = cloth.positions.copy(), cloth.velocities.copy()
        positions[self.vertex] = positions[cloth.held] + self._beside
        velocities[self.vertex] = velocities[cloth.held]
        return replace(cloth, positions=positions, velocities=velocities)

    def _next(self, cloth: ClothState) -> int:
        """The vertex of another layer nearest to the held one, within the picker's reach; -1 for none."""
        same = np.zeros(len(cloth.positions), bool)
        same[cloth.held] = True
        for _ in range(APART - 1):
            same[self._edges[same[self._edges].any(axis=1)]] = True
        distance = np.linalg.norm(cloth.positions - cloth.positions[cloth.held], axis=1)
        distance[same] = np.inf
        nearest = int(distance.argmin())
        return nearest if distance[nearest] <= REACH_M else -1
