"""What a dynamics model is made of, and the sizes that have a name."""

from dataclasses import dataclass
from typing import Literal

HISTORY = 5
"""Past velocities a node knows (MEDOR, dynamics model)."""
STEP_S = 0.05
"""Time of one model step: five frames [s]."""
PULL_STEPS = 10
"""Steps of the pull from pick to place."""
STEPS = 16
"""Steps of a rollout: the pull and six to fall (MEDOR, section IV-C)."""


@dataclass(frozen=True)
class Preset:
    """Size and conventions of a model. The defaults are MEDOR's."""

    width: int = 128
    """Of every hidden layer, node, edge and global vector."""
    blocks: int = 10
    """Rounds of message passing."""
    global_vector: bool = True
    """One vector per graph that all nodes and edges read."""
    radius_m: float = 0.036
    """Nodes nearer than this share collision edges [m]."""
    nearest: int = 0
    """Collision edges a node receives at most, from the nearest; 0: all within the radius."""
    close_mesh_edges: bool = True
    """Whether neighbours in the mesh that are close share collision edges too."""
    rest: Literal["start", "true"] = "start"
    """Rest length of a mesh edge: its length before the action, or between the garment's nodes as it is worn."""
    frame: Literal["world", "pull"] = "world"
    """Axes the model thinks in: `pull` has x along the pull, so that a turned scene gives the turned rollout."""
    normalize: bool = False
    """Features and accelerations in units of their spread over the training data."""
    length_passes: int = 0
    """Passes by which mesh edges get their lengths back after every step, 0: they keep what the network gave them."""


PAPER = Preset()
CPU = Preset(
    width=64,
    blocks=5,
    global_vector=False,
    nearest=8,
    close_mesh_edges=False,
    frame="pull",
    normalize=True,
    length_passes=5,
)
"""Small enough for 500 rollouts in seconds on two cores."""
PRESETS = {"paper": PAPER, "cpu": CPU}
