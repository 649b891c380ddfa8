"""Every message that travels between services: frozen, typed, shape-checked.

World frame: metres, right-handed, z up, table at z = 0. Canonical space: the worn pose, z the body axis, front -y.
"""

from functools import cache
from typing import Annotated, ClassVar, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from medor_wire.arrays import Shape, Vector3

Category = Literal["trousers", "tshirt", "dress", "skirt", "jumpsuit"]
Task = Literal["flatten", "canonicalize"]
StartState = Literal["drop", "flat", "picks"]
Executor = Literal["picker", "panda"]
"""Who carries a pick-and-place out in the simulated cell: the flying gripper or the arm. A real cell has its arm."""

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I4 = NDArray[np.int32]
Bools = NDArray[np.bool_]


class Message(BaseModel):
    """Base of all messages. Unknown fields are ignored, so that a newer peer may add optional ones."""

    model_config = ConfigDict(frozen=True, extra="ignore", arbitrary_types_allowed=True)
    VERSION: ClassVar[int] = 1
    """Major version; a peer refuses a frame of another one."""

    @model_validator(mode="after")
    def _dimensions_agree(self) -> Self:
        sizes: dict[str, tuple[int, str]] = {}
        for name, shape in array_fields(type(self)).items():
            value = getattr(self, name)
            for dim, size in shape.sizes(value).items() if value is not None else ():
                seen, where = sizes.setdefault(dim, (size, name))
                if seen != size:
                    raise ValueError(f"dimension {dim} is {seen} in {where} but {size} in {name}")
        return self

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, name), getattr(other, name)) for name in type(self).model_fields)


def _same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other)  # type: ignore[arg-type]
    return one == other


@cache
def array_fields(message: type[Message]) -> dict[str, Shape]:
    """The shape of every array field, optional ones included."""
    found: dict[str, Shape] = {}
    for name, field in message.model_fields.items():
        parts = [*field.metadata, *(x for arg in get_args(field.annotation) for x in get_args(arg))]
        for shape in (part for part in parts if isinstance(part, Shape)):
            found[name] = shape
    return found


class Empty(Message):
    """No content."""


# --- what the camera sees -------------------------------------------------------------------------------------


class CameraInfo(Message):
    """A pinhole camera: intrinsics [px] and pose (OpenCV axes: x right, y down, z forward)."""

    K: Annotated[F8, Shape("3 3", "f8")]
    T_world_camera: Annotated[F8, Shape("4 4", "f8")]
    width: int = Field(gt=0, le=4096)
    height: int = Field(gt=0, le=4096)


class DepthView(Message):
    """One depth image. `depth` [m] is the distance along the optical axis, 0 where nothing was measured."""

    depth: Annotated[F4, Shape("H W", "f4")]
    camera: CameraInfo
    mask: Annotated[Bools, Shape("H W", "?")] | None = None
    """True on the garment; when absent it is segmented by height above the table."""
    stamp_ns: int = 0
    """Time of capture, nanoseconds since the epoch."""

    @model_validator(mode="after")
    def _camera_matches(self) -> Self:
        if self.depth.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"depth is {self.depth.shape} but the camera says ({self.camera.height}, {self.camera.width})"
            )
        return self


# --- cloth ----------------------------------------------------------------------------------------------------


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
    method: str = "visible"


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


# --- the cell (the simulated and the real one answer alike) -------------------------------------------------------


class LeaseRequest(Message):
    holder: str = Field(min_length=1, max_length=128)
    """Presence id of the asker: when it vanishes the robot stops and the lease is revoked."""
    action: Literal["acquire", "renew", "release"] = "acquire"
    epoch: int = 0
    """The epoch being renewed or released."""


class Lease(Message):
    epoch: int
    """Fencing epoch: an act with an older one is refused."""
    ttl_s: float


class ActRequest(Message):
    """One pick-and-place. The same `action_id` again gets the recorded outcome and moves nothing."""

    action_id: str = Field(min_length=1, max_length=128)
    epoch: int
    pick: Vector3
    place: Vector3
    executor: Executor = "picker"


class ActOutcome(Message):
    action_id: str
    grasped: bool
    replayed: bool = False
    """True when this is the recorded outcome of an earlier call."""
    arm_reached: bool = True
    """False when the arm could not follow the flying picker to the end of the path."""
    seconds: float = 0.0
    detail: str = ""
    """What else there is to say, such as that nothing moved in a dry run."""


class ReachRequest(Message):
    """Whether the tool gets to points [m] or, with `places`, whether pulls from points to places can be done."""

    points: Annotated[F4, Shape("K 3", "f4")]
    places: Annotated[F4, Shape("K 3", "f4")] | None = None
    executor: Executor = "picker"


class Reach(Message):
    reachable: Annotated[Bools, Shape("K", "?")]


class CellStatus(Message):
    cell: Literal["sim", "robot"]
    state: Literal["idle", "moving", "stopped"]
    """`stopped`: the e-stop is latched."""
    category: Category | None = None
    """Of the garment on the table, where the cell knows it."""
    holder: str | None = None
    epoch: int = 0
    actions: int = 0
    """Actions executed since the start."""
    camera: CameraInfo | None = None
    detail: str = ""


class ClearStop(Message):
    """Operator's order to clear a latched e-stop."""

    operator: str = Field(min_length=1, max_length=128)


class EmergencyStop(Message):
    reason: str = ""
    source: str = ""


# --- simulated cell only -------------------------------------------------------------------------------------------


class ResetRequest(Message):
    category: Category = "tshirt"
    garment_seed: int = Field(default=1, ge=0, lt=2**31)
    garment_id: str | None = None
    """An uploaded garment; takes precedence over `garment_seed`."""
    state: StartState = "drop"
    seed: int = Field(default=0, ge=0, lt=2**31)


class Score(Message):
    """The referee's figures for the state on the table (simulator's truth; for reports, never for planning)."""

    coverage_m2: float
    flat_coverage_m2: float
    ni_flatten: float
    """Normalized improvement in coverage since the reset."""
    ni_canonicalize: float
    canonical_cost_m: float
    picks: int


class Truth(Message):
    """The true state of the simulated garment."""

    mesh: ClothMesh
    garment_id: str


class UploadGarment(Message):
    content: bytes = Field(max_length=64 << 20)
    file_type: Literal["obj", "ply", "glb"]
    category: Category


class GarmentId(Message):
    garment_id: str
    vertices: int
    faces: int


# --- planning ------------------------------------------------------------------------------------------------------


class PlanRequest(Message):
    category: Category
    task: Task = "flatten"
    method: str = "visible"
    view: DepthView | None = None
    """Absent: the cell is asked for one."""
    candidates: int = Field(default=100, ge=1, le=5000)
    seed: int = Field(default=0, ge=0, lt=2**31)
    executor: Executor = "picker"
    exhaustive: bool = False
    """Roll every candidate out with the method's own model; none is screened out by a smaller one."""
    report: int = Field(default=20, ge=1, le=5000)
    """How many of the best candidates the plan tells."""


class PlanProgress(Message):
    stage: Literal["capture", "reconstruct", "goals", "sample", "screen", "rollout"]
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
    method: str = "visible"
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
    timings_ms: dict[str, float] = {}
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


# --- infrastructure ------------------------------------------------------------------------------------------------


class Heartbeat(Message):
    """Health of one process, published at 1 Hz from its work loop."""

    service: str
    id: str
    boot: str
    ready: bool
    detail: str = ""
    busy: int = 0
    uptime_s: float = 0.0
