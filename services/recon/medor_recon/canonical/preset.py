"""How a canonicalisation network is built and taught: every choice, and the named combinations of them."""

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal


@dataclass(frozen=True)
class Preset:
    """Choices of one network.

    Attributes:
        network: `hrnet` sees an image, `pointnet` the visible points.
        view: what of the 200 px image `hrnet` sees: a window of `size` pixels around the cloth (`crop`) or the whole
            of it, resampled to `size` pixels (`whole`).
        size: side of the network's input [px].
        heights: feed height above the table and the mask; otherwise raw depth, 0 off the cloth.
        width: channels of the finest branch; each next one has twice as many.
        modules: of stages 2, 3, 4 …, each with one branch more.
        blocks: residual blocks of each branch of a module.
        bottlenecks: blocks of stage 1; without any, stage 2 follows the stem.
        stem: channels of the stem.
        norm: `batch` or `group` (of 8 channels).
        head: where it works: on the coarse feature map, its logits then interpolated (`map`), or on features
            interpolated at the pixels asked for (`pixels`).
        hidden: channels of the head's hidden layer.
        head_norm: normalise it.
        bins: of each axis.
        symmetric: compare with the garment turned about its body axis in the way that fits best (`symmetry`), or with
            the garment as it is.
        rough: learn from views with noise, errors of mask and mount, and mirrored garments; otherwise only turned ones.
        pixels: of each view that are learnt from at a time; the points that `pointnet` sees.
        batch: views of a step.
        lr: highest learning rate.
        side: weight of the loss that teaches which side is up; 0 for none, and the answer that all is as it is.
    """

    network: Literal["hrnet", "pointnet"] = "hrnet"
    view: Literal["crop", "whole"] = "crop"
    size: int = 128
    heights: bool = True
    width: int = 16
    modules: tuple[int, ...] = (1, 1, 1)
    blocks: int = 2
    bottlenecks: int = 0
    stem: int = 64
    norm: Literal["batch", "group"] = "batch"
    head: Literal["map", "pixels"] = "pixels"
    hidden: int = 256
    head_norm: bool = False
    bins: int = 64
    symmetric: bool = True
    rough: bool = True
    pixels: int = 256
    batch: int = 16
    lr: float = 1.5e-3
    side: float = 0.1

    @property
    def channels(self) -> int:
        """Of the features: all branches side by side, or the last layer of PointNet++."""
        return self.width * (2 ** (len(self.modules) + 1) - 1) if self.network == "hrnet" else 128

    def to_json(self) -> dict[str, Any]:
        return asdict(self) | {"modules": list(self.modules)}

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "Preset":
        settings: dict[str, Any] = {**values, "modules": tuple(values["modules"])}
        return cls(**settings)


CPU = Preset()
"""What two cores learn in hours."""
PAPER = Preset(
    view="whole",
    size=200,
    heights=False,
    width=32,
    modules=(1, 4, 3),
    blocks=4,
    bottlenecks=4,
    head="map",
    hidden=480,
    head_norm=True,
    symmetric=False,
    rough=False,
    pixels=2000,
    batch=8,
    lr=1e-4,
    side=0.0,
)
"""HRNet-W32 as published (MEDOR, section 5.1 and the released code): 480 features a pixel, 64 bins an axis."""
GARMENTNETS = replace(PAPER, network="pointnet", head="pixels", hidden=128, head_norm=False, pixels=6000)
"""PointNet++ on 6,000 points (GarmentNets; MEDOR, baselines)."""
GARMENTNETS_SMALL = replace(GARMENTNETS, pixels=1024, symmetric=True, rough=True, lr=1.5e-3, side=0.1)
"""The same on points and a schedule that two cores can afford, with the loss of `cpu`."""

PRESETS = {
    "cpu": CPU,
    "paper-small": CPU,
    "paper": PAPER,
    "garmentnets": GARMENTNETS,
    "garmentnets-small": GARMENTNETS_SMALL,
}
