"""A sewing pattern: flat panels, the seams that join them and what the sewn garment must look like."""

import math
from dataclasses import dataclass

from medor_cloth.outline import Curve

EdgeName = tuple[str, str]
"""(panel, edge), for example ("front", "side_right")."""


@dataclass(frozen=True)
class Panel:
    """One flat piece of cloth."""

    edges: dict[str, Curve]
    """The outline, counter-clockwise: named curves in order, each ending where the next begins [m]."""
    front: bool
    """Whether it is worn on the front of the body."""


@dataclass(frozen=True)
class Seam:
    """Two panel edges sewn together point by point."""

    first: EdgeName
    second: EdgeName
    opposed: bool = False
    """Whether the two edges run in opposite directions (two panels side by side instead of back to back)."""


@dataclass(frozen=True)
class Pattern:
    """Everything needed to sew a garment, at the scale of a human body."""

    panels: dict[str, Panel]
    seams: tuple[Seam, ...]
    boundary_loops: int
    """How many closed rims the garment has: neck, cuffs, hems, …"""
    opening: tuple[EdgeName, EdgeName] | None = None
    """The two edges of a front opening, which face each other without being sewn."""
    flatness: float = 0.0
    """How strongly the body under the garment is flattened front to back, in [0, 1]."""
    lift_above: float = -math.inf
    """Panel height below which inflation does not push up or down; else a skirt flips over the bodice [m]."""


def back_to_back(*edges: str) -> tuple[Seam, ...]:
    """Seams between equal edges of the panels "front" and "back"."""
    return tuple(Seam(("front", edge), ("back", edge)) for edge in edges)
