"""`/plan` and `/plans/*`: choose a pick-and-place, and carry it out once."""

from typing import Annotated

from fastapi import APIRouter, Header, Response

from medor_gateway.auth import MOVE, PLAN, READ
from medor_gateway.door import Door, DoorOf
from medor_gateway.http_models import OutcomeReport, PlanCommand, PlanResult, PlanState, Progress
from medor_gateway.jobs import Job
from medor_gateway.problem import ASKS, documented
from medor_gateway.records import PlanRecord, plan_state
from medor_wire import endpoints
from medor_wire.errors import NotFound, Refused
from medor_wire.messages import ExecuteRequest, Message, PlanProgress, PlanRequest

router = APIRouter(tags=["plans"])


@router.post(
    "/plan",
    dependencies=[PLAN],
    response_model=PlanResult,
    responses={202: {"model": PlanState, "description": "Being made (`Prefer: respond-async`); see `Location`."}}
    | documented(400, 404, 409, 413, 422, *ASKS),
)
def make_plan(command: PlanCommand, door: DoorOf, prefer: Annotated[str, Header()] = "") -> PlanResult | Response:
    """Choose the best pick-and-place; nothing moves. With `Prefer: respond-async` answers at once and plans on."""
    job = _start(door, command.message())
    if "respond-async" in prefer:
        headers = {"Location": f"/plans/{job.id}", "Preference-Applied": "respond-async"}
        return Response(plan_state(job).model_dump_json(), 202, headers, media_type="application/json")
    job.ended.wait()
    if job.error:
        raise job.error
    assert job.record.plan is not None
    return job.record.plan


@router.get("/plans/{plan_id}", dependencies=[READ], responses=documented(404, 422))
def plan(plan_id: str, door: DoorOf) -> PlanState:
    """A plan in the making, or made."""
    return plan_state(door.plans.find(plan_id))


@router.delete("/plans/{plan_id}", status_code=202, dependencies=[PLAN], responses=documented(404, 422))
def cancel_plan(plan_id: str, door: DoorOf) -> PlanState:
    """Stop making a plan. One that is made already stays as it is."""
    job = door.plans.find(plan_id)
    job.cancel.set()
    return plan_state(job)


@router.post("/plans/{plan_id}/execute", dependencies=[MOVE], responses=documented(400, 404, 409, 422, *ASKS))
def execute(plan_id: str, door: DoorOf) -> OutcomeReport:
    """Carry a plan out, once: the same call again answers the recorded outcome and moves nothing."""
    request = ExecuteRequest(plan_id=_planner_id(door, plan_id))
    return OutcomeReport.of(door.ask(endpoints.EXECUTE, request))


def _planner_id(door: Door, plan_id: str) -> str:
    """The planner's own id of a plan. What this process does not know, the planner may: it is passed on."""
    try:
        job = door.plans.find(plan_id)
    except NotFound:
        return plan_id
    if job.record.plan is None:
        raise Refused(f"expected a plan that is made, {plan_id!r} is {job.status}")
    return job.record.plan.plan_id


def _start(door: Door, request: PlanRequest) -> Job[PlanRecord]:
    def work(job: Job[PlanRecord]) -> None:
        def note(message: Message) -> None:
            assert isinstance(message, PlanProgress)
            job.record.progress = Progress(stage=message.stage, fraction=message.fraction)

        plan = door.ask(endpoints.PLAN, request, note, job.cancel)
        job.names.add(job.record.finish(plan, door.meshes).plan_id)

    return door.plans.start(PlanRecord(), work)
