"""What travels over HTTP: the JSON twins of the wire's messages, arrays as lists or PNG, each with an example.

Requests are strict: unknown fields and silent conversions are refused. Metres, world frame, unless a name says else.
"""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat

from medor_cloth.picture import PNG_UNIT_M
from medor_gateway.jobs import Status
from medor_gateway.media import decode_depth, decode_mask, encode_depth, encode_mask
from medor_gateway.problem import Problem
from medor_wire.messages import (
    F4,
    F8,
    ActOutcome,
    CameraInfo,
    Category,
    CellStatus,
    DepthView,
    EpisodePick,
    EpisodeRequest,
    Executor,
    GarmentId,
    Plan,
    PlanRequest,
    ResetRequest,
    Score,
    StartState,
    Task,
)


def _unicode(text: str) -> str:
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise ValueError("expected valid Unicode") from error
    return text


Text = Annotated[str, AfterValidator(_unicode)]
Seed = Annotated[int, Field(ge=0, lt=2**31, description="The same seed gives the same result.")]
MethodName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,63}$", description="A named planner preset.")]
ExecutorName = Annotated[
    Executor, Field(description="Simulated cell only: the flying gripper of the paper, or the Panda arm.")
]
EndReason = Literal["solved", "max_picks", "no_op"]
Triple = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Point = tuple[float, float, float]
Quadruple = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]
Png = Annotated[
    str,
    Field(max_length=48 << 20, json_schema_extra={"contentEncoding": "base64", "contentMediaType": "image/png"}),
]


class Command(BaseModel):
    """Base of what is sent to the door."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Report(BaseModel):
    """Base of what the door answers. Messages may have more to say."""

    model_config = ConfigDict(frozen=True, extra="ignore")


def _example(**values: Any) -> ConfigDict:
    return ConfigDict(json_schema_extra={"examples": [values]})


def point(xyz: F4 | F8) -> Point:
    """An array of three as a JSON list."""
    x, y, z = xyz.tolist()
    return x, y, z


# --- what the camera sees -------------------------------------------------------------------------------------


class Observation(Command):
    """One depth image and where it was taken. What `GET /cell/observation` answers, `POST /plan` accepts."""

    depth_png: Annotated[Png, Field(description="16-bit grey PNG; 0: nothing measured.")]
    depth_unit_m: Annotated[float, Field(gt=0, le=0.01, description="Metres per step of the PNG.")] = PNG_UNIT_M
    mask_png: Annotated[Png, Field(description="8-bit PNG, not 0 on the garment.")] | None = None
    K: Annotated[list[Triple], Field(min_length=3, max_length=3, description="Camera intrinsics [px], 3 x 3.")]
    T_world_camera: Annotated[
        list[Quadruple],
        Field(min_length=4, max_length=4, description="Camera pose, 4 x 4; x right, y down, z forward (OpenCV)."),
    ]
    stamp_s: Annotated[float, Field(ge=0, le=1e11, description="Time of capture since the epoch.")] = 0.0

    model_config = _example(
        depth_png=encode_depth(np.full((8, 8), 0.65, np.float32)),
        K=[[9.66, 0.0, 4.0], [0.0, 9.66, 4.0], [0.0, 0.0, 1.0]],
        T_world_camera=[[1.0, 0, 0, 0], [0, -1.0, 0, 0], [0, 0, -1.0, 0.65], [0, 0, 0, 1.0]],
    )

    @classmethod
    def of(cls, view: DepthView) -> "Observation":
        return cls(
            depth_png=encode_depth(view.depth),
            mask_png=None if view.mask is None else encode_mask(view.mask),
            K=view.camera.K.tolist(),
            T_world_camera=view.camera.T_world_camera.tolist(),
            stamp_s=view.stamp_ns / 1e9,
        )

    def view(self) -> DepthView:
        """As a message.

        Raises:
            BadRequest: a PNG that is none, or of the wrong kind.
        """
        depth = decode_depth(self.depth_png, self.depth_unit_m)
        height, width = depth.shape
        camera = CameraInfo(
            K=np.array(self.K), T_world_camera=np.array(self.T_world_camera), width=width, height=height
        )
        mask = None if self.mask_png is None else decode_mask(self.mask_png)
        return DepthView(depth=depth, camera=camera, mask=mask, stamp_ns=round(self.stamp_s * 1e9))


# --- the cell -------------------------------------------------------------------------------------------------


class ResetCommand(Command):
    """Put a garment on the table of the simulated cell."""

    category: Category = "tshirt"
    garment_seed: Seed = 1
    garment_id: Annotated[Text, Field(max_length=128, description="An uploaded garment, instead of a seed.")] | None = (
        None
    )
    state: StartState = "drop"
    seed: Seed = 0

    model_config = _example(category="tshirt", garment_seed=1, state="drop", seed=0)

    def message(self) -> ResetRequest:
        return ResetRequest.model_validate(self.model_dump())


class ScoreReport(Report):
    """The simulator's figures for the state on the table."""

    coverage_m2: float
    flat_coverage_m2: float
    ni_flatten: float
    ni_canonicalize: float
    canonical_cost_m: float
    picks: int

    @classmethod
    def of(cls, score: Score) -> "ScoreReport":
        return cls.model_validate(score.model_dump())


class GarmentReport(Report):
    """An uploaded garment."""

    garment_id: str
    vertices: int
    faces: int

    @classmethod
    def of(cls, garment: GarmentId) -> "GarmentReport":
        return cls.model_validate(garment.model_dump())


class CellReport(Report):
    """The state of the cell."""

    cell: Literal["sim", "robot"]
    state: Literal["idle", "moving", "stopped"] = Field(description="`stopped`: the e-stop is latched.")
    category: Category | None
    holder: str | None = Field(description="Who holds the lease of the robot.")
    epoch: int
    actions: int
    detail: str

    @classmethod
    def of(cls, status: CellStatus) -> "CellReport":
        return cls.model_validate(status.model_dump(exclude={"camera"}))


class StopCommand(Command):
    reason: Annotated[Text, Field(max_length=256)] = ""

    model_config = _example(reason="a hand on the table")


class StopReport(Report):
    """The stop is on its way; `GET /cell/status` says when the cell has latched it."""

    sent: Literal[True] = True


class ClearCommand(Command):
    """An operator's word that it is safe to move again."""

    operator: Annotated[Text, Field(min_length=1, max_length=128)]

    model_config = _example(operator="ada")


# --- planning -------------------------------------------------------------------------------------------------


Exhaustive = Annotated[bool, Field(description="Leave none to a smaller model: roll every candidate out.")]


class PlanOptions(Command):
    candidates: Annotated[int, Field(ge=1, le=5000, description="Pick-and-places tried in the model.")] = 100
    seed: Seed = 0
    executor: ExecutorName = "picker"
    exhaustive: Exhaustive = False


class PlanCommand(Command):
    """Choose the best pick-and-place for what is seen."""

    category: Category
    task: Task = "flatten"
    method: MethodName = "visible"
    observation: Annotated[Observation | None, Field(description="Absent: the cell's camera is asked.")] = None
    options: PlanOptions = PlanOptions()

    model_config = _example(category="tshirt", task="flatten", method="visible", options={"candidates": 100, "seed": 0})

    def message(self) -> PlanRequest:
        return PlanRequest(
            category=self.category,
            task=self.task,
            method=self.method,
            view=self.observation and self.observation.view(),
            candidates=self.options.candidates,
            seed=self.options.seed,
            executor=self.options.executor,
            exhaustive=self.options.exhaustive,
        )


class Action(Report):
    """A pick-and-place: where the picker closes and where it opens."""

    pick: Point
    place: Point


class Candidate(Action):
    reward: float


class Predicted(Report):
    """Flatten: coverage [m²]. Canonicalize: minus the mean distance to the best goal [m]."""

    reward: float
    no_op_reward: float = Field(description="Of doing nothing.")


class MeshLink(Report):
    url: str = Field(examples=["/meshes/5f2a.glb"])
    vertices: int
    faces: int


class PlanResult(Report):
    plan_id: str
    category: Category
    task: Task
    method: str
    action: Action | None = Field(description="null: doing nothing is predicted best.")
    predicted: Predicted
    mesh: MeshLink
    candidates: list[Candidate] = Field(description="The best ones, best first.")
    evaluated: int = Field(description="Candidates tried in the model.")
    timings_ms: dict[str, float]

    @classmethod
    def of(cls, plan: Plan) -> "PlanResult":
        tops = zip(plan.top_picks, plan.top_places, plan.top_rewards, strict=True)
        return cls(
            plan_id=plan.plan_id,
            category=plan.category,
            task=plan.task,
            method=plan.method,
            action=None if plan.no_op else Action(pick=point(plan.pick), place=point(plan.place)),
            predicted=Predicted(reward=plan.reward, no_op_reward=plan.no_op_reward),
            mesh=MeshLink(
                url=f"/meshes/{plan.plan_id}.glb", vertices=len(plan.mesh.vertices), faces=len(plan.mesh.faces)
            ),
            candidates=[Candidate(pick=point(p), place=point(q), reward=float(r)) for p, q, r in tops],
            evaluated=plan.candidates,
            timings_ms=plan.timings_ms,
        )


class Progress(Report):
    stage: str
    fraction: float


class PlanState(Report):
    """A plan in the making, or made."""

    id: str
    status: Status
    progress: Progress | None
    plan: PlanResult | None
    error: Problem | None


class OutcomeReport(Report):
    """What became of a pick-and-place."""

    action_id: str
    grasped: bool
    replayed: bool = Field(description="True: the recorded outcome of an earlier call; nothing moved now.")
    arm_reached: bool
    seconds: float
    detail: str

    @classmethod
    def of(cls, outcome: ActOutcome) -> "OutcomeReport":
        return cls.model_validate(outcome.model_dump())


# --- episodes -------------------------------------------------------------------------------------------------


class EpisodeOptions(Command):
    candidates: Annotated[int, Field(ge=1, le=5000)] = 100
    executor: ExecutorName = "picker"
    exhaustive: Exhaustive = False


class EpisodeCommand(Command):
    """Unfold in closed loop. Without a garment and a start state: go on from what lies on the table."""

    category: Category = "tshirt"
    task: Task = "flatten"
    method: MethodName = "visible"
    max_picks: Annotated[int, Field(ge=1, le=100)] = 10
    garment_seed: Seed | None = None
    garment_id: Annotated[Text, Field(max_length=128, description="Goes before `garment_seed`.")] | None = None
    state: StartState | None = None
    seed: Seed = 0
    options: EpisodeOptions = EpisodeOptions()

    model_config = _example(
        category="tshirt", task="flatten", method="visible", max_picks=10, garment_seed=1, state="drop", seed=0
    )

    def message(self) -> EpisodeRequest:
        return EpisodeRequest(
            category=self.category,
            task=self.task,
            method=self.method,
            max_picks=self.max_picks,
            candidates=self.options.candidates,
            seed=self.seed,
            executor=self.options.executor,
            exhaustive=self.options.exhaustive,
            reset=self._reset(),
        )

    def _reset(self) -> ResetRequest | None:
        if self.garment_seed is None and self.garment_id is None and self.state is None:
            return None
        return ResetRequest(
            category=self.category,
            garment_seed=1 if self.garment_seed is None else self.garment_seed,
            garment_id=self.garment_id,
            state=self.state or "drop",
            seed=self.seed,
        )


class PickReport(Report):
    """One step of an episode. Index 0 is the start, without an action."""

    index: int
    pick: Point | None
    place: Point | None
    no_op: bool
    reward: float
    no_op_reward: float
    coverage_m2: float
    ni: float = Field(description="Normalized improvement in the episode's task since its start.")
    timings_ms: dict[str, float]
    url: str = Field(description="What was seen and considered.", examples=["/episodes/5f2a/picks/1"])

    @classmethod
    def of(cls, step: EpisodePick, episode_id: str) -> "PickReport":
        plain = step.model_dump(exclude={"pick", "place", "view", "plan"})
        return cls(
            **plain,
            pick=None if step.pick is None else point(step.pick),
            place=None if step.place is None else point(step.place),
            url=f"/episodes/{episode_id}/picks/{step.index}",
        )


class PickDetail(PickReport):
    observation: Observation | None = Field(description="What the camera saw before the action.")
    plan: PlanResult | None


class EpisodeState(Report):
    id: str
    status: Status
    category: Category
    task: Task
    method: str
    max_picks: int
    progress: Progress | None = Field(description="Where the running pick stands.")
    ni: float | None = Field(description="Of the last step; null before the first.")
    reason: EndReason | None = Field(description="Why it ended, once done.")
    flat_coverage_m2: float | None
    picks: list[PickReport]
    error: Problem | None


class EpisodeList(Report):
    episodes: list[EpisodeState] = Field(description="Newest first.")


# --- health ---------------------------------------------------------------------------------------------------


class InstanceHealth(Report):
    id: str
    ready: bool = Field(description="Alive, warm, and heard of lately.")
    age_s: float | None = Field(description="Since its last heartbeat.")
    busy: int
    uptime_s: float
    detail: str


class ServiceHealth(Report):
    ready: bool = Field(description="At least one instance is.")
    instances: list[InstanceHealth]


class Readiness(Report):
    ready: bool = Field(description="All required services are.")
    services: dict[str, ServiceHealth]


class Alive(Report):
    status: Literal["ok"] = "ok"
    version: str
    uptime_s: float
