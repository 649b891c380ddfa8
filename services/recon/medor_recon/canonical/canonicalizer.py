"""A trained network at work: a depth view in, canonical coordinates of the pixels on the cloth out."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from medor_cloth.camera import HEIGHT_M, Camera
from medor_cloth.dataset import box_of
from medor_learn import weights
from medor_learn.errors import WeightsError
from medor_recon.canonical import inputs
from medor_recon.canonical.head import Decoding, decode
from medor_recon.canonical.network import Prediction, build
from medor_recon.canonical.overhead import CAMERA, overhead_depth
from medor_recon.canonical.preset import Preset
from medor_recon.canonical.symmetry import sides, turned_points
from medor_recon.canonical.views import SIDE_PX
from medor_recon.canonicalized import Canonicalized
from medor_wire.errors import BadRequest, NoGarment

STRIDE = 32
"""Windows grow in these steps [px]; the coarsest features have this resolution."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One answer to which side of the garment is up."""

    probability: float
    canonicalized: Canonicalized


@dataclass(frozen=True, eq=False)
class _View:
    """The cloth in the overhead camera's image."""

    depth: NDArray[np.float32]
    pixels: NDArray[np.int32]
    points: NDArray[np.float32]


class Canonicalizer:
    """Answers where on the garment every visible point is.

    Args:
        module: the network.
        config: it was built from.
        decoding: how coordinates are read off the bins.
    """

    def __init__(self, module: nn.Module, config: dict[str, Any], decoding: Decoding = "mean") -> None:
        self.module = module.eval()
        self.preset = Preset.from_json(config["preset"])
        self.categories = tuple(config["categories"])
        self.decoding: Decoding = decoding
        self.device = next(module.parameters()).device
        _check_boxes(config)

    @classmethod
    def load(cls, folder: Path, device: str = "auto", decoding: Decoding = "mean") -> "Canonicalizer":
        """A network from its folder of weights.

        Raises:
            WeightsError: it does not fit, or was taught in other NOCS boxes.
        """
        if device == "auto":
            device = "cuda" if torch.cuda.is_available() else "cpu"
        return cls(*weights.load(folder, build, device), decoding)

    def canonicalize(self, category: str, depth: NDArray[np.float32], camera: Camera) -> Canonicalized:
        """The likeliest canonical coordinates of a view.

        Args:
            category: of the garment.
            depth: (H, W) [m], 0 off the cloth.
            camera: which took it.

        Raises:
            NoGarment: nothing is seen where the overhead camera looks.
            BadRequest: a category this network was not taught.
        """
        return self.hypotheses(category, depth, camera)[0].canonicalized

    def hypotheses(self, category: str, depth: NDArray[np.float32], camera: Camera) -> list[Hypothesis]:
        """One answer for each side that the category can show, the likeliest first; see `canonicalize`."""
        if category not in self.categories:
            raise BadRequest(f"category: expected one of {', '.join(self.categories)}, got {category!r}")
        view = self._view(depth, camera)
        with torch.inference_mode():
            said = self._ask(view, category)
            nocs, confidence = (_numpy(part[0]) for part in decode(said.logits, self.decoding))
            features, side = _numpy(said.features[0].float()), _numpy(said.side[0].float().softmax(-1))
        seen = Canonicalized(category, view.pixels, view.points, nocs, confidence, features, CAMERA)
        if sides(category) == 1:
            return [Hypothesis(1.0, seen)]
        other = replace(seen, nocs=turned_points(nocs, category, 1))
        answers = [Hypothesis(float(side[0]), seen), Hypothesis(float(side[1]), other)]
        return sorted(answers, key=lambda answer: -answer.probability)

    def _view(self, depth: NDArray[np.float32], camera: Camera) -> _View:
        depth = overhead_depth(depth, camera)
        pixels = np.argwhere(depth > 0).astype(np.int32)
        if len(pixels) == 0:
            raise NoGarment("expected cloth where the overhead camera looks, got none")
        if self.preset.network == "pointnet":
            pixels = np.random.default_rng(0).permutation(pixels)[: self.preset.pixels]
        rows, columns = pixels.T
        return _View(depth, pixels, CAMERA.back_project(depth)[rows, columns])

    def _ask(self, view: _View, category: str) -> Prediction:
        number = torch.tensor([self.categories.index(category)], device=self.device)
        seen = (torch.from_numpy(view.points)[None],) if self.preset.network == "pointnet" else self._window(view)
        return self.module(*(part.to(self.device) for part in seen), number)

    def _window(self, view: _View) -> tuple[Tensor, Tensor]:
        """The image a network is shown, and where in it the pixels are."""
        if self.preset.view == "whole":
            nearest = ((np.arange(self.preset.size) + 0.5) * SIDE_PX / self.preset.size).astype(int)
            depth, corner, size = view.depth[np.ix_(nearest, nearest)], 0, SIDE_PX
        else:
            low, high = view.pixels.min(0), view.pixels.max(0) + 1
            size = max(self.preset.size, int(-(-(high - low).max() // STRIDE) * STRIDE))
            corner = (low + high - size) // 2
            depth = _cut(view.depth, corner, size)
        heights = None if self.preset.heights else depth[None]
        image = inputs.image(HEIGHT_M - depth[None], depth[None] > 0, heights)
        return image, inputs.shares(view.pixels[None] - corner, (size, size))


def _cut(image: NDArray[np.float32], corner: NDArray, size: int) -> NDArray[np.float32]:
    """(size, size) part of an image (H, W) that may reach beyond it; 0 there."""
    padded = np.pad(image, size)
    row, column = corner + size
    return padded[row : row + size, column : column + size]


def _check_boxes(config: dict[str, Any]) -> None:
    for category in config["categories"]:
        taught, ours = config["nocs_boxes"][category], box_of(category)
        if not np.allclose(taught, ours):
            raise WeightsError(f"expected a network taught in the NOCS box {ours} of {category}, got {taught}")


def _numpy(values: Tensor) -> NDArray[np.float32]:
    return values.cpu().numpy()
