"""How long and with which weights finetuning runs; the paper's ablations are other weights."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Phase:
    """A stretch of iterations with one set of weights and one optimiser, which starts without momentum."""

    iterations: int = 50
    chamfer: float = 1.0
    """Weight of the observed points' distance to the visible vertices."""
    consistency: float = 10.0
    """Weight of the vertices' distance to the points observed at the same canonical coordinate."""
    table: float = 10.0
    """Weight of what lies lower than cloth on a table can."""
    stretch: float = 0.0
    """Weight of edges longer than in canonical space; not in the paper's method."""


@dataclass(frozen=True)
class Isometry:
    """A first layout that keeps lengths; not in the paper's method."""

    weight: float = 2.0
    """Of an edge's deformation, against a vertex's distance to the points that share its canonical coordinate."""
    doubt_m: float = 0.05
    """Distance at which such a point counts a quarter [m]."""
    iterations: int = 15


@dataclass(frozen=True)
class RefineConfig:
    """All of finetuning's constants."""

    isometry: Isometry | None = None
    phases: tuple[Phase, ...] = (Phase(), Phase(consistency=0.0))
    """Canonical coordinates first bring every vertex roughly home; their error must not hold it there."""
    learning_rate: float = 1e-3
    """About the way of a vertex along each axis in one iteration [m]: a phase cannot repair more than 5 cm."""
    look_every: int = 5
    """Iterations between two looks at which vertices are visible."""
    reach: float = 2 / 64
    """Farthest observed cell that a vertex is bound to, in the NOCS cube."""


PAPER = RefineConfig()
JOINT = RefineConfig(phases=(Phase(iterations=100),))
"""Canonical coordinates hold to the end (MEDOR, ablation "joint optimization")."""
NO_CONSISTENCY = RefineConfig(phases=(Phase(consistency=0.0), Phase(consistency=0.0)))
"""Canonical coordinates are not used (MEDOR, ablation "no consistency")."""
HELD = RefineConfig(phases=(Phase(stretch=1.0), Phase(consistency=0.0, stretch=1.0)))
"""With an edge prior: what moves takes its neighbours along, hidden ones too."""
ISOMETRIC = RefineConfig(isometry=Isometry(), phases=(Phase(consistency=0.0, stretch=5.0),))
"""Laid out with its lengths kept, then moved onto the points with the edge prior."""
