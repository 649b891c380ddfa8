"""The robot baseline: a pick near the outline, a place off the cloth, no model (MEDOR, section V-D)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_planner.sampling import Candidates, Reachable, Scene, sample

CLEARANCE_M = 0.02
"""A place is off the cloth when no vertex is nearer than this, seen from above [m]."""


def random_action(scene: Scene, rng: np.random.Generator, reachable: Reachable) -> Candidates:
    """One candidate, drawn like those of random shooting but with its place beside the garment."""
    return sample(scene, 1, rng, reachable=reachable, place_allowed=OffTheCloth(scene))


@dataclass(frozen=True)
class OffTheCloth:
    """Tests whether points (..., 3) lie beside the garment, seen from above."""

    scene: Scene

    @cached_property
    def _nearest(self) -> KDTree:
        return KDTree(self.scene.mesh.vertices[:, :2])

    def __call__(self, points: NDArray[np.float32]) -> NDArray[np.bool_]:
        distance, _ = self._nearest.query(points[..., :2])
        return distance > CLEARANCE_M
