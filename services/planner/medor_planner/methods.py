"""Methods: named presets of what the planner sees, what it plans with and where its goals come from."""

from dataclasses import dataclass
from typing import Literal

from medor_wire.errors import BadRequest


@dataclass(frozen=True)
class Method:
    """One way to plan."""

    name: str
    recon: str | None
    """Reconstruction method that makes the mesh; None: the simulator's true mesh."""
    dynamics: str | None
    """Backend that rolls candidates out; None: no model, one random pick-and-place."""
    goals: Literal["mesh", "template"] = "template"
    """Whose canonical pose is the goal of `canonicalize`: the planned mesh's own, or a fixed garment's of the
    category, whose vertices do not correspond with the mesh."""


VISIBLE = Method("visible", recon="visible", dynamics="physics")
"""Only what the camera sees, rolled out by the cloth solver."""
ORACLE = Method("oracle", recon=None, dynamics="physics", goals="mesh")
"""The true mesh, rolled out by the cloth solver: the upper bound (MEDOR, ablations). Simulation only."""
ORACLE_MESH = Method("oracle-mesh", recon=None, dynamics="learned", goals="mesh")
"""The true mesh, rolled out by the learned model: what reconstruction costs (MEDOR, ablations). Simulation only."""
RANDOM = Method("random", recon="visible", dynamics=None)
"""A pick near the outline, a place off the cloth (MEDOR, robot baseline)."""

MEDOR = Method("medor", recon="medor", dynamics="learned", goals="mesh")
"""The mesh completed from the view and finetuned on it, rolled out by the learned model; goals are made of its own
canonical pose (MEDOR)."""
COMPLETED = (MEDOR,) + tuple(
    Method(f"{recon}+physics", recon=recon, dynamics="physics", goals="mesh")
    for recon in ("medor", "held", "no-finetuning", "joint", "no-consistency", "no-relative", "garmentnets")
)
"""The completed mesh, rolled out by the cloth solver: MEDOR's "ground-truth dynamics" and the ablations of its
reconstruction."""

METHODS = {method.name: method for method in (VISIBLE, ORACLE, ORACLE_MESH, RANDOM, *COMPLETED)}


def method_named(name: str) -> Method:
    """The preset of that name.

    Raises:
        BadRequest: there is none.
    """
    if name not in METHODS:
        raise BadRequest(f"expected a method of {', '.join(METHODS)}, got {name!r}")
    return METHODS[name]
