"""What the door remembers of plans, episodes and meshes; pictures as PNG, so that many fit."""

from collections import OrderedDict
from dataclasses import dataclass, field
from threading import Lock

from medor_gateway.http_models import (
    EndReason,
    EpisodeState,
    Observation,
    PickDetail,
    PickReport,
    PlanResult,
    PlanState,
    Progress,
)
from medor_gateway.jobs import Job
from medor_wire.errors import NotFound
from medor_wire.messages import ClothMesh, EpisodePick, EpisodeRequest, Plan


class Shelf:
    """The newest meshes by id."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._meshes: OrderedDict[str, ClothMesh] = OrderedDict()
        self._lock = Lock()

    def put(self, mesh_id: str, mesh: ClothMesh) -> None:
        """Keep a mesh, forgetting the oldest when there are too many."""
        with self._lock:
            self._meshes[mesh_id] = mesh
            self._meshes.move_to_end(mesh_id)
            while len(self._meshes) > self._size:
                self._meshes.popitem(last=False)

    def get(self, mesh_id: str) -> ClothMesh:
        """The mesh.

        Raises:
            NotFound: never seen, or forgotten for newer ones.
        """
        with self._lock:
            if mesh_id not in self._meshes:
                raise NotFound(f"expected the id of a recent mesh, got {mesh_id!r}")
            return self._meshes[mesh_id]


@dataclass
class PlanRecord:
    """A plan being made, or made."""

    progress: Progress | None = None
    plan: PlanResult | None = None

    def finish(self, plan: Plan, meshes: Shelf) -> PlanResult:
        """Note the finished plan and keep its mesh."""
        meshes.put(plan.plan_id, plan.mesh)
        self.plan = PlanResult.of(plan)
        return self.plan


@dataclass(frozen=True)
class Step:
    """One step of an episode with what was seen and considered."""

    report: PickReport
    observation: Observation | None
    plan: PlanResult | None

    @classmethod
    def of(cls, pick: EpisodePick, episode_id: str, meshes: Shelf) -> "Step":
        """From the planner's progress message; its mesh is kept."""
        return cls(
            report=PickReport.of(pick, episode_id),
            observation=pick.view and Observation.of(pick.view),
            plan=pick.plan and PlanRecord().finish(pick.plan, meshes),
        )

    def detail(self) -> PickDetail:
        """All of it."""
        return PickDetail(**self.report.model_dump(), observation=self.observation, plan=self.plan)


@dataclass
class EpisodeRecord:
    """An episode so far."""

    request: EpisodeRequest
    steps: list[Step] = field(default_factory=list)
    progress: Progress | None = None
    ni: float | None = None
    flat_coverage_m2: float | None = None
    reason: EndReason | None = None

    def step(self, index: int) -> Step:
        """The step with this index.

        Raises:
            NotFound: not there (yet).
        """
        for step in self.steps:
            if step.report.index == index:
                return step
        raise NotFound(f"expected a pick of this episode, 0 to {len(self.steps) - 1}, got {index}")


def plan_state(job: Job[PlanRecord]) -> PlanState:
    """A plan's job as JSON."""
    record = job.record
    return PlanState(id=job.id, status=job.status, progress=record.progress, plan=record.plan, error=job.problem)


def episode_state(job: Job[EpisodeRecord]) -> EpisodeState:
    """An episode's job as JSON."""
    record, request = job.record, job.record.request
    return EpisodeState(
        id=job.id,
        status=job.status,
        category=request.category,
        task=request.task,
        method=request.method,
        max_picks=request.max_picks,
        progress=record.progress if job.status == "running" else None,
        ni=record.ni,
        reason=record.reason,
        flat_coverage_m2=record.flat_coverage_m2,
        picks=[step.report for step in record.steps],
        error=job.problem,
    )
