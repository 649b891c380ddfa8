"""Plans, their execution, and closed-loop episodes."""

from typing import Annotated, Literal

from pydantic import Field

from medor_wire.arrays import Shape, Vector3
from medor_wire.messages.base import F4, F8, Category, Executor, Message, Task
from medor_wire.messages.cloth import ClothMesh
from medor_wire.messages.simulated import ResetRequest
from medor_wire.messages.view import DepthView

DEFAULT_METHOD = "medor+judge"
"""How to see and foresee where nothing else is asked for."""


class PlanRequest(Message):
    category: Category
    task: Task = "flatten"
    method: str = DEFAULT_METHOD
    view: DepthView | None = None
    """Absent: the cell is asked for one."""
    candidates: int = Field(default=100, ge=1, le=5000)
    seed: int = Field(default=0, ge=0, lt=2**31)
    executor: Executor = "picker"
    exhaustive: bool = False
    """Roll every candidate out with the method's own model; none is screened out by a rougher one. A judged method
    rolls out as many as `candidates` says, those that a glance likes best of all that were drawn."""
    report: int = Field(default=20, ge=1, le=5000)
    """How many of the best candidates the plan tells."""


class PlanProgress(Message):
    stage: Literal["capture", "reconstruct", "goals", "sample", "screen", "rollout", "judge"]
    fraction: float


class Plan(Message):
    plan_id: str
    category: Category
    task: Task
    method: str
    no_op: bool
    """True when doing nothing is predicted best: nothing will be executed."""
    pick: Vector3
    place: Vector3
    reward: float
    """Predicted for the chosen action; units as in `Rollouts.rewards`."""
    no_op_reward: float
    mesh: ClothMesh
    top_picks: Annotated[F4, Shape("T 3", "f4")]
    """The best candidates that were rolled out, best first."""
    top_places: Annotated[F4, Shape("T 3", "f4")]
    top_rewards: Annotated[F8, Shape("T", "f8")]
    candidates: int
    """Drawn, the no-op not counted."""
    survivors: int | None = None
    """Those of them that the method's own model was asked about; the others were screened out."""
    executor: Executor = "picker"
    """Whose reach the candidates were sampled in; carries the plan out."""
    timings_ms: dict[str, float]


class ExecuteRequest(Message):
    plan_id: str


class EpisodeRequest(Message):
    category: Category = "tshirt"
    task: Task = "flatten"
    method: str = DEFAULT_METHOD
    max_picks: int = Field(default=10, ge=1, le=100)
    candidates: int = Field(default=100, ge=1, le=5000)
    seed: int = Field(default=0, ge=0, lt=2**31)
    executor: Executor = "picker"
    exhaustive: bool = False
    """As in `PlanRequest`."""
    reset: ResetRequest | None = None
    """Absent: go on from what lies on the table."""
    stop_ni: float = 0.95
    """Ends early above this normalized improvement (MEDOR, experiments)."""


class EpisodePick(Message):
    """One closed-loop step, reported when its action has ended. Index 0 is the start state, without an action."""

    index: int
    pick: Vector3 | None = None
    place: Vector3 | None = None
    no_op: bool = False
    reward: float = 0.0
    no_op_reward: float = 0.0
    coverage_m2: float
    ni: float
    """Of the episode's task."""
    timings_ms: dict[str, float] = Field(default_factory=dict)
    view: DepthView | None = None
    """What the camera saw before the action."""
    plan: Plan | None = None


class EpisodeProgress(Message):
    """`step` when a pick has ended, else where the running pick stands."""

    step: EpisodePick | None = None
    planning: PlanProgress | None = None


class Episode(Message):
    ni: float
    picks: tuple[EpisodePick, ...]
    """Without views and plans, which travel as progress."""
    flat_coverage_m2: float
    reason: Literal["solved", "max_picks", "no_op"]
