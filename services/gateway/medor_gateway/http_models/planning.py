"""Plans and what became of them."""

from typing import Annotated

from pydantic import Field

from medor_gateway.http_models.base import Command, ExecutorName, MethodName, Point, Report, Seed, example, point
from medor_gateway.http_models.observation import Observation
from medor_gateway.jobs import Status
from medor_gateway.problem import Problem
from medor_wire.messages import (
    DEFAULT_METHOD,
    ActOutcome,
    Category,
    Plan,
    PlanRequest,
    Task,
)

Exhaustive = Annotated[bool, Field(description="Leave none to a rougher model: roll every candidate out.")]


class PlanOptions(Command):
    candidates: Annotated[int, Field(ge=1, le=5000, description="Pick-and-places tried in the model.")] = 100
    seed: Seed = 0
    executor: ExecutorName = "picker"
    exhaustive: Exhaustive = False


class PlanCommand(Command):
    """Choose the best pick-and-place for what is seen."""

    category: Category
    task: Task = "flatten"
    method: MethodName = DEFAULT_METHOD
    observation: Annotated[Observation | None, Field(description="Absent: the cell's camera is asked.")] = None
    options: PlanOptions = PlanOptions()

    model_config = example(
        category="tshirt", task="flatten", method=DEFAULT_METHOD, options={"candidates": 100, "seed": 0}
    )

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
