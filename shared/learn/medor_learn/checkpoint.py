"""All a training run needs to go on as if it had never stopped."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from medor_learn.errors import ResumeError


@dataclass
class Standing:
    """Where a run stands, beside the network and its optimizer.

    Nothing is kept of random generators: every step seeds them anew.
    """

    step: int = 0
    """Steps done."""
    hours: float = 0.0
    """Of CPU time, over all resumptions."""
    losses: list[float] = field(default_factory=list)
    """Of the steps since the last validation."""
    best: dict[str, float] = field(default_factory=dict)
    """Metrics of the best validation."""
    best_step: int = 0
    validated: int = -1
    """Step of the last validation."""
    stale: int = 0
    """Validations since the best one."""


def write(path: Path, standing: Standing, config: dict[str, Any], **parts: dict[str, Any]) -> None:
    """Replace the checkpoint at once; `parts` are the state dicts of the network and the optimizer."""
    partial = path.with_name(f".{path.name}.partial")
    torch.save({"standing": vars(standing), "config": config, **parts}, partial)
    partial.replace(path)


def read(path: Path, config: dict[str, Any]) -> dict[str, Any]:
    """What `write` was given, `standing` as a `Standing`.

    Raises:
        ResumeError: the checkpoint belongs to another configuration.
    """
    found = torch.load(path, map_location="cpu", weights_only=True)
    if found["config"] != config:
        raise ResumeError(f"{path.parent} holds a run of another configuration: {_difference(found['config'], config)}")
    return found | {"standing": Standing(**found["standing"])}


def _difference(found: dict[str, Any], wanted: dict[str, Any], prefix: str = "") -> str:
    parts = []
    for name in sorted(found.keys() | wanted.keys()):
        a, b = found.get(name), wanted.get(name)
        if isinstance(a, dict) and isinstance(b, dict):
            parts.append(_difference(a, b, f"{prefix}{name}."))
        elif a != b:
            parts.append(f"{prefix}{name} was {a!r}, now {b!r}")
    return "; ".join(part for part in parts if part)
