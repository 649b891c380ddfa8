"""One held-out observation with its truth."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera, overhead
from medor_cloth.dataset import Dataset, Trajectory
from medor_cloth.garment import Garment
from medor_cloth.raster import visible_vertices
from medor_recon.canonicalized import Canonicalized


@dataclass(frozen=True, eq=False)
class Observed:
    """A view of a garment whose state is known.

    Attributes:
        trajectory, step: where it is stored.
    """

    trajectory: Trajectory
    step: int

    @property
    def key(self) -> str:
        """Its name among all observations of a data set."""
        record = self.trajectory.garment
        return f"{record.category}/{record.seed:06d}/{self.trajectory.id:06d}/{self.step}"

    @property
    def category(self) -> str:
        return self.trajectory.garment.category

    @property
    def garment(self) -> Garment:
        return self.trajectory.garment.garment

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """(H, W) where cloth is seen."""
        return self.trajectory["mask"][self.step] & (self.trajectory["depth"][self.step] > 0)

    @cached_property
    def depth(self) -> NDArray[np.float32]:
        """(H, W) [m], 0 off the cloth."""
        return np.where(self.mask, self.trajectory["depth"][self.step], 0).astype(np.float32)

    @cached_property
    def nocs(self) -> NDArray[np.float32]:
        """(H, W, 3) true canonical coordinates, 0 off the cloth."""
        return self.trajectory["nocs"][self.step]

    @cached_property
    def positions(self) -> NDArray[np.float32]:
        """(V, 3) true vertices, world frame [m]."""
        return self.trajectory["positions"][self.step]

    @cached_property
    def camera(self) -> Camera:
        return overhead(self.depth.shape[1])

    @cached_property
    def visible(self) -> NDArray[np.bool_]:
        """(V,) true vertices that the camera sees."""
        return visible_vertices(self.positions, self.garment.faces, self.camera)

    @cached_property
    def truth(self) -> Canonicalized:
        """What a faultless canonicaliser would say."""
        pixels = np.argwhere(self.mask).astype(np.int32)
        nocs = self.nocs[self.mask]
        return Canonicalized(
            category=self.category,
            pixels=pixels,
            points=self.camera.back_project(self.depth)[self.mask],
            nocs=nocs,
            confidence=np.ones_like(nocs),
            features=np.zeros((len(nocs), 0), np.float32),
            camera=self.camera,
        )

    def true_nocs(self, points: NDArray[np.floating]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """True canonical coordinates (P, 3) of observed world points (P, 3), and which lie on the cloth (P,)."""
        uv, _ = self.camera.project(points)
        column, row = np.clip(uv.astype(int), 0, np.array(self.mask.shape[::-1]) - 1).T
        return self.nocs[row, column], self.mask[row, column]


def observations(dataset: Dataset, looks: int | None = None) -> Iterator[Observed]:
    """The observations of a data set of kind `recon`, or `looks` of them evenly spread, in its order."""
    every = [(trajectory, step) for trajectory in dataset for step in range(trajectory["depth"].shape[0])]
    chosen = np.linspace(0, len(every) - 1, min(looks or len(every), len(every))).round().astype(int)
    for index in chosen:
        yield Observed(*every[index])
