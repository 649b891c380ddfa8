"""Methods: named presets of what the planner sees, what it plans with and where its goals come from."""

from dataclasses import dataclass, replace
from typing import Literal

from medor_wire.errors import BadRequest


@dataclass(frozen=True)
class Method:
    """One way to plan."""

    name: str
    recon: str | None
    """Reconstruction method that makes the mesh; None: the simulator's true mesh."""
    dynamics: Literal["learned", "physics", "layerless"] | None
    """Backend that rolls candidates out; None: no model, one random pick-and-place."""
    goals: Literal["mesh", "template"] = "template"
    """Whose canonical pose is the goal of `canonicalize`: the planned mesh's own, or a fixed garment's of the
    category, whose vertices do not correspond with the mesh."""
    visible_reward: bool = False
    """Whether hidden cloth is rolled out but does not count."""
    judged: bool = False
    """Whether several models are asked, the named one first, and a judge who has learnt what comes of it decides."""

    @property
    def with_physics(self) -> "Method":
        """The same, rolled out by the cloth solver; completed layers run through each other, so it lets them."""
        return replace(self, name=f"{self.name}+physics", dynamics="layerless")


VISIBLE = Method("visible", recon="visible", dynamics="physics")
"""Only what the camera sees, rolled out by the cloth solver."""
ORACLE = Method("oracle", recon=None, dynamics="physics", goals="mesh")
"""The true mesh, rolled out by the cloth solver: the upper bound (MEDOR, ablations). Simulation only."""
ORACLE_MESH = Method("oracle-mesh", recon=None, dynamics="learned", goals="mesh")
"""The true mesh, rolled out by the learned model: what reconstruction costs (MEDOR, ablations). Simulation only."""
RANDOM = Method("random", recon="visible", dynamics=None)
"""A pick near the outline, a place off the cloth (MEDOR, robot baseline)."""

COMPLETED = tuple(
    Method(recon, recon, dynamics="learned", goals="mesh")
    for recon in ("medor", "isometric", "no-finetuning", "joint", "no-consistency", "no-relative", "garmentnets")
)
"""The mesh completed from the view, rolled out by the learned model; goals are made of its own canonical pose. First
MEDOR, then the ablations of its reconstruction."""
JUDGED = tuple(
    Method(name, recon, dynamics="layerless", goals="mesh", judged=True)
    for name, recon in (("medor+judge", "medor"), ("oracle-mesh+judge", None))
)
"""The completed mesh, rolled out by the cloth solver, on lengths kept, and by the learned model; the judge decides. The
same on the true mesh, simulation only: what reconstruction costs."""
PARTIAL_REWARD = replace(COMPLETED[0], name="partial-reward", visible_reward=True)
"""MEDOR, judging only what it saw (MEDOR, ablations)."""
LEARNED = (*COMPLETED, PARTIAL_REWARD)

METHODS = {
    method.name: method
    for method in (VISIBLE, ORACLE, ORACLE_MESH, RANDOM, *JUDGED, *LEARNED, *(each.with_physics for each in LEARNED))
}
"""All by name. `+physics`: the same with the cloth solver, MEDOR's ground-truth dynamics."""


def method_named(name: str) -> Method:
    """The preset of that name.

    Raises:
        BadRequest: there is none.
    """
    if name not in METHODS:
        raise BadRequest(f"expected a method of {', '.join(METHODS)}, got {name!r}")
    return METHODS[name]
