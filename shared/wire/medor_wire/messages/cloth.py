"""Meshes: made from a view, laid flat, rolled out and rated."""

from typing import Annotated, Self

from pydantic import model_validator

from medor_wire.arrays import Shape
from medor_wire.messages.base import F4, F8, I4, Bools, Category, Message, Task
from medor_wire.messages.view import DepthView


class ClothMesh(Message):
    """A garment's mesh on the table, as far as it is known."""

    vertices: Annotated[F4, Shape("V 3", "f4")]
    """Task space [m]."""
    faces: Annotated[I4, Shape("F 3", "i4")]
    category: Category
    visible: Annotated[Bools, Shape("V", "?")]
    """Vertices the camera sees."""
    canonical: Annotated[F4, Shape("V 3", "f4")] | None = None
    """The same vertices in canonical space [m]."""
    panel_uv: Annotated[F4, Shape("F 3 2", "f4")] | None = None
    """Flat panel coordinates per face corner [m]: the rest shape. Absent: at rest in canonical space, or as it lies."""
    confidence: Annotated[F4, Shape("V", "f4")] | None = None
    """How sure reconstruction is of each vertex, from 0 to 1; where it is the truth, or all seen, there is none."""

    @model_validator(mode="after")
    def _faces_in_range(self) -> Self:
        if self.faces.size == 0:
            raise ValueError("a cloth mesh needs at least one face")
        low, high = int(self.faces.min()), int(self.faces.max())
        if low < 0 or high >= len(self.vertices):
            raise ValueError(f"faces index vertices {low}..{high} of {len(self.vertices)}")
        return self


class ReconstructRequest(Message):
    view: DepthView
    category: Category
    method: str = "medor"


class Reconstruction(Message):
    mesh: ClothMesh
    timings_ms: dict[str, float]
    """By stage."""


class ReconstructProgress(Message):
    stage: str
    """The stage that has begun, named as in `Reconstruction.timings_ms`."""


class FlattenRequest(Message):
    """Make the goal poses of a canonical mesh: one flattened copy per symmetry element (MEDOR, canonicalization)."""

    category: Category
    canonical: Annotated[F4, Shape("V 3", "f4")]
    faces: Annotated[I4, Shape("F 3", "i4")]
    panel_uv: Annotated[F4, Shape("F 3 2", "f4")] | None = None


class GoalSet(Message):
    """Goal poses in task space, vertices in correspondence with the canonical mesh asked for."""

    goals: Annotated[F4, Shape("S V 3", "f4")]
    flat_coverage_m2: float


class Reward(Message):
    """How the final state of a rollout is scored."""

    task: Task
    goals: Annotated[F4, Shape("S G 3", "f4")] | None = None
    """Goal poses for `canonicalize`. `matched`: goal vertex i belongs to mesh vertex i, else nearest neighbours."""
    matched: bool = True
    visible_only: bool = False
    """Score only what the camera saw before the action (MEDOR, ablation of the reward)."""

    @model_validator(mode="after")
    def _goals_given(self) -> Self:
        if self.task == "canonicalize" and self.goals is None:
            raise ValueError("canonicalize needs goals")
        return self


class RolloutRequest(Message):
    """K candidate pick-and-places on one mesh. A candidate whose pick grasps nothing leaves the cloth as it is."""

    mesh: ClothMesh
    picks: Annotated[F4, Shape("K 3", "f4")]
    """Picker centre at the grasp, task space [m]."""
    places: Annotated[F4, Shape("K 3", "f4")]
    reward: Reward
    backend: str = "physics"
    seed: int = 0


class Rollouts(Message):
    positions: Annotated[F4, Shape("K V 3", "f4")]
    """Final vertex positions [m]."""
    rewards: Annotated[F8, Shape("K", "f8")]
    """Flatten: coverage [m²]. Canonicalize: minus the mean distance to the best goal [m]."""
    seconds: float


class RolloutProgress(Message):
    done: int
    total: int
