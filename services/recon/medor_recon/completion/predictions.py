"""Views as a trained canonicaliser sees them, computed once and kept on disk: it is frozen while completion learns."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera
from medor_recon.canonicalized import Canonicalized
from medor_recon.completion.observations import CAMERA, Observation, Prediction
from medor_recon.completion.pixels import Pixels, thinned
from medor_recon.completion.turn import Turn, winning

Canonicalize = Callable[[str, NDArray[np.float32], Camera], Canonicalized]
"""Category, depth (H, W) [m] with 0 off the cloth, and camera to canonical coordinates."""
PARTS = ("points", "nocs", "confidence", "features")


class Predictions:
    """A canonicaliser's view of any observation.

    Args:
        canonicalize: the canonicaliser.
        folder: one canonicaliser's predictions, a file a trajectory; made if need be.
        spacing: of the pixels kept, on the table [m]; must stay the same for a folder.
        features: keep the network's features, too (a thousand bytes a pixel); must stay the same for a folder.
    """

    def __init__(self, canonicalize: Canonicalize, folder: Path, spacing: float, features: bool = False) -> None:
        self.canonicalize, self.folder, self.spacing, self.features = canonicalize, folder, spacing, features

    def __call__(self, observation: Observation) -> Prediction:
        """The view of the pixels on the cloth, and how the garment is turned in it."""
        record, trajectory = observation.trajectory.garment, observation.trajectory
        path = self.folder / record.category / f"{record.seed:06d}-{trajectory.id:06d}.npz"
        if not path.exists():
            self._compute(observation, path)
        with np.load(path) as file:
            parts = [file[f"{observation.step}.{part}"].astype(np.float32) for part in PARTS]
            turn = Turn(file[f"{observation.step}.turn"])
        return Prediction(Pixels(record.category, *parts), turn)

    def seen(self, observation: Observation) -> Canonicalized:
        """The same view unthinned, computed anew."""
        trajectory, step = observation.trajectory, observation.step
        return self._canonicalized(trajectory.garment.category, trajectory["depth"][step], trajectory["mask"][step])

    def _canonicalized(self, category: str, depth: NDArray[np.float32], mask: NDArray[np.bool_]) -> Canonicalized:
        return self.canonicalize(category, np.where(mask, depth, 0), CAMERA)

    def _compute(self, observation: Observation, path: Path) -> None:
        """All views of a trajectory."""
        trajectory = observation.trajectory
        arrays = [trajectory[name] for name in ("depth", "mask", "nocs")]
        content: dict[str, NDArray] = {}
        for step, (depth, mask, nocs) in enumerate(zip(*arrays, strict=True)):
            seen = self._canonicalized(trajectory.garment.category, depth, mask)
            turn = winning(seen.category, seen.nocs, _true(nocs, seen))
            pixels = thinned(seen if self.features else replace(seen, features=seen.features[:, :0]), self.spacing)
            content |= {f"{step}.{part}": _compact(part, getattr(pixels, part)) for part in PARTS}
            content[f"{step}.turn"] = turn.matrix
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{os.getpid()}.{path.name}")
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **content)
        partial.replace(path)


def _compact(part: str, values: NDArray[np.float32]) -> NDArray:
    return values if part == "points" else values.astype(np.float16)


def _true(nocs: NDArray[np.float32], seen: Canonicalized) -> NDArray[np.float32]:
    """True coordinates (P, 3) at the pixels of a view of another resolution."""
    scale = np.array(nocs.shape[:2]) / (seen.camera.height, seen.camera.width)
    rows, columns = ((seen.pixels + 0.5) * scale).astype(int).T
    return nocs[rows, columns]
