"""Trained completions as folders: a network's weights and config (`medor_learn.weights`), templates beside them."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from torch import nn

from medor_learn import weights
from medor_learn.errors import WeightsError
from medor_recon.completion.completion import Completion
from medor_recon.completion.field import Field, FieldConfig
from medor_recon.completion.field_completion import FieldCompletion
from medor_recon.completion.fill import FillConfig, PooledFill
from medor_recon.completion.template import Templates
from medor_recon.completion.template_completion import TemplateCompletion

KINDS: dict[str, tuple[type, type]] = {"field": (Field, FieldConfig), "fill": (PooledFill, FillConfig)}
"""Networks and their sizes, by the config's `kind`."""


def describe(network: FieldConfig | FillConfig, categories: tuple[str, ...]) -> dict[str, Any]:
    """What `build` needs, as JSON."""
    kind = "field" if isinstance(network, FieldConfig) else "fill"
    return {"kind": kind, "network": asdict(network), "categories": list(categories)}


def build(config: Mapping[str, Any]) -> nn.Module:
    """The network of a config, with random weights.

    Raises:
        WeightsError: the config is of another kind of network.
    """
    if config.get("kind") not in KINDS:
        raise WeightsError(f"expected a completion of kind {' or '.join(KINDS)}, got {config.get('kind')!r}")
    module, sizes = KINDS[config["kind"]]
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in config["network"].items()}
    return module(sizes(**values), tuple(config["categories"]))


def load(folder: Path, device: str = "cpu") -> Completion:
    """The completion a folder holds, ready to use.

    Raises:
        WeightsError: what is missing or does not fit.
    """
    module, config = weights.load(folder, build, device)
    if isinstance(module, Field):
        return FieldCompletion(module, config.get("thresholds", {}), config["spacing"])
    assert isinstance(module, PooledFill)
    return TemplateCompletion(load_templates(folder, config["categories"]), module)


def templates_path(folder: Path, category: str) -> Path:
    """Where a folder keeps a category's templates."""
    return folder / f"templates-{category}.npz"


def load_templates(folder: Path, categories: list[str]) -> dict[str, Templates]:
    """The templates of each category.

    Raises:
        WeightsError: a category has none.
    """
    missing = [category for category in categories if not templates_path(folder, category).exists()]
    if missing:
        raise WeightsError(f"{folder}: expected templates of {', '.join(missing)}")
    return {category: Templates.from_bytes(templates_path(folder, category).read_bytes()) for category in categories}
