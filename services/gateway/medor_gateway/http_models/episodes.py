"""Closed-loop episodes."""

from typing import Annotated

from pydantic import Field

from medor_gateway.http_models.base import (
    Command,
    EndReason,
    ExecutorName,
    MethodName,
    Point,
    Report,
    Seed,
    Text,
    example,
    point,
)
from medor_gateway.http_models.observation import Observation
from medor_gateway.http_models.planning import Exhaustive, PlanResult, Progress
from medor_gateway.jobs import Status
from medor_gateway.problem import Problem
from medor_wire.messages import (
    DEFAULT_METHOD,
    Category,
    EpisodePick,
    EpisodeRequest,
    ResetRequest,
    StartState,
    Task,
)


class EpisodeOptions(Command):
    candidates: Annotated[int, Field(ge=1, le=5000)] = 100
    executor: ExecutorName = "picker"
    exhaustive: Exhaustive = False


class EpisodeCommand(Command):
    """Unfold in closed loop. Without a garment and a start state: go on from what lies on the table."""

    category: Category = "tshirt"
    task: Task = "flatten"
    method: MethodName = DEFAULT_METHOD
    max_picks: Annotated[int, Field(ge=1, le=100)] = 10
    garment_seed: Seed | None = None
    garment_id: Annotated[Text, Field(max_length=128, description="Goes before `garment_seed`.")] | None = None
    state: StartState | None = None
    seed: Seed = 0
    options: EpisodeOptions = EpisodeOptions()

    model_config = example(
        category="tshirt", task="flatten", method=DEFAULT_METHOD, max_picks=10, garment_seed=1, state="drop", seed=0
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
