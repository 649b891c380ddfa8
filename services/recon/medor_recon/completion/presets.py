"""Completions by name."""

from dataclasses import dataclass, replace

from medor_recon.completion.augment import Augmentation
from medor_recon.completion.field import FieldConfig
from medor_recon.completion.fill import FillConfig


@dataclass(frozen=True)
class Preset:
    """A network, what it is fed and how it learns.

    Attributes:
        network: sizes of the field, or of the fill beside its templates.
        spacing: of the pixels it is fed, on the table [m]; 0 for all.
        augmentation: of what it learns from.
        batch: views a step.
        lr: highest learning rate.
        queries: of either kind and view, or vertices of a view.
        templates: greatest number a category, for the fill.
    """

    network: FieldConfig | FillConfig
    spacing: float
    augmentation: Augmentation
    batch: int
    lr: float
    queries: int
    templates: int = 0


PAPER = Preset(FieldConfig(), 0.0, Augmentation(predicted=1.0, mirrored=0.0, noise=0.0), 24, 1e-4, 6000)
"""MEDOR, section III-B and the released code: 489 features a pixel, 32³ nodes of 128 features, 128³ winding numbers."""
PAPER_SMALL = Preset(
    FieldConfig(
        features=0,
        aggregation=(64, 32),
        grid=24,
        maps=16,
        levels=3,
        volume_features=32,
        decoder=(256, 256, 256),
        batch_norm=False,
        framed=True,
        position_weight=100.0,
        nodes=64,
    ),
    spacing=0.005,
    augmentation=Augmentation(),
    batch=2,
    lr=1e-3,
    queries=2000,
)
"""The same structure, to be learnt on two cores."""
CPU = Preset(FillConfig(), 0.008, Augmentation(), 8, 1e-3, 512, templates=40)
"""Templates and a fill: no volumes at all."""


def _changed(preset: Preset, **network: object) -> Preset:
    return replace(preset, network=replace(preset.network, **network))  # type: ignore[arg-type]


# `garmentnets-small` differs from `paper-small-no-relative` by the canonicaliser that it is taught with.
PRESETS = {
    "cpu": CPU,
    "paper-small": PAPER_SMALL,
    "paper-small-no-relative": _changed(PAPER_SMALL, relative=False),
    "garmentnets-small": _changed(PAPER_SMALL, relative=False),
    "paper": PAPER,
    "paper-no-relative": _changed(PAPER, relative=False),
    "garmentnets": _changed(PAPER, features=128, aggregation=(137, 128), relative=False),
}
