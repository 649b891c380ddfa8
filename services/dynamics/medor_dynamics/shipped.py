"""Weights of dynamics models on disk."""

from pathlib import Path
from typing import Any

from medor_dynamics.model import Dynamics
from medor_dynamics.preset import Preset
from medor_learn import weights

DEFAULT = Path(__file__).parent / "weights" / "cpu"
"""The model that comes with this package."""


def load(folder: Path, device: str = "cpu") -> Dynamics:
    """The model of a folder written by training, on a device.

    Raises:
        WeightsError: there is none, or it does not fit.
    """
    model, _ = weights.load(folder, build, device)
    assert isinstance(model, Dynamics)
    return model


def build(config: dict[str, Any]) -> Dynamics:
    """A model of the preset a config describes."""
    return Dynamics(Preset(**config["preset"]))
