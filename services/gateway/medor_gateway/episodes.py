"""`/episodes/*`: unfold in closed loop, follow it, look at every pick, cancel."""

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Path, Response
from sse_starlette import EventSourceResponse, JSONServerSentEvent

from medor_gateway.auth import MOVE, READ
from medor_gateway.door import Door, DoorOf
from medor_gateway.http_models import EpisodeCommand, EpisodeList, EpisodeState, PickDetail, Progress
from medor_gateway.jobs import Job
from medor_gateway.problem import documented
from medor_gateway.records import EpisodeRecord, Step, episode_state
from medor_wire import endpoints
from medor_wire.errors import Busy
from medor_wire.messages import EpisodePick, EpisodeProgress, EpisodeRequest, Message, PlanProgress

router = APIRouter(prefix="/episodes", tags=["episodes"])

PROGRESS_STEP = 0.1
"""Progress within a stage is told when it grew by this much, so that event logs stay short."""


@router.post("", status_code=202, dependencies=[MOVE], responses=documented(400, 413, 422, 429))
def start_episode(command: EpisodeCommand, door: DoorOf, response: Response) -> EpisodeState:
    """Observe, reconstruct, plan, act, again; until solved, until nothing helps, or `max_picks` times."""
    job = _start(door, command.message())
    response.headers["Location"] = f"/episodes/{job.id}"
    return episode_state(job)


@router.get("", dependencies=[READ])
def list_episodes(door: DoorOf) -> EpisodeList:
    """The recent episodes."""
    return EpisodeList(episodes=[episode_state(job) for job in door.episodes.newest()])


@router.get("/{episode_id}", dependencies=[READ], responses=documented(404, 422))
def episode(episode_id: str, door: DoorOf) -> EpisodeState:
    """How far an episode has come."""
    return episode_state(door.episodes.find(episode_id))


@router.delete("/{episode_id}", status_code=202, dependencies=[MOVE], responses=documented(404, 422))
def cancel_episode(episode_id: str, door: DoorOf) -> EpisodeState:
    """Stop an episode. Its picks so far stay readable; one that has ended stays as it is."""
    job = door.episodes.find(episode_id)
    job.cancel.set()
    return episode_state(job)


@router.get("/{episode_id}/picks/{index}", dependencies=[READ], responses=documented(404, 422))
def pick(episode_id: str, index: Annotated[int, Path(ge=0, le=1000)], door: DoorOf) -> PickDetail:
    """One pick with what the camera saw before it, the mesh and the best candidates."""
    return door.episodes.find(episode_id).record.step(index).detail()


@router.get(
    "/{episode_id}/events",
    dependencies=[READ],
    response_class=EventSourceResponse,
    responses={
        200: {"description": "Events `planning`, `pick` and `end`; the stream ends with the episode."},
        204: {"description": "All events up to `Last-Event-ID` were the whole story: do not reconnect."},
    }
    | documented(404, 422, 429),
)
async def events(
    episode_id: str,
    door: DoorOf,
    last_event_id: Annotated[int, Header(ge=0, lt=2**31, description="Go on after this event.")] = 0,
) -> Response:
    """Server-sent events of an episode, from its start or after `Last-Event-ID`."""
    job = door.episodes.find(episode_id)
    fresh, more = job.events(last_event_id)
    if not fresh and not more:
        return Response(status_code=204)
    if door.streams >= door.config.streams_at_once:
        raise Busy(f"expected fewer than {door.config.streams_at_once} followers, all are taken")
    return EventSourceResponse(_stream(door, job, last_event_id))


async def _stream(door: Door, job: Job[EpisodeRecord], after: int) -> AsyncIterator[JSONServerSentEvent]:
    door.streams += 1  # on the event loop only
    try:
        async for event in job.follow(after):
            yield JSONServerSentEvent(event.data, event=event.name, id=str(event.id))
    finally:
        door.streams -= 1


def _start(door: Door, request: EpisodeRequest) -> Job[EpisodeRecord]:
    def work(job: Job[EpisodeRecord]) -> None:
        def note(message: Message) -> None:
            assert isinstance(message, EpisodeProgress)
            if message.planning:
                _note_planning(job, message.planning)
            if message.step:
                _note_step(door, job, message.step)

        record = job.record
        episode = door.ask(endpoints.EPISODE, request, note, job.cancel)
        record.ni, record.reason, record.flat_coverage_m2 = episode.ni, episode.reason, episode.flat_coverage_m2

    return door.episodes.start(EpisodeRecord(request), work)


def _note_planning(job: Job[EpisodeRecord], planning: PlanProgress) -> None:
    last = job.record.progress
    if last and last.stage == planning.stage and 0 <= planning.fraction - last.fraction < PROGRESS_STEP:
        return
    job.record.progress = Progress(stage=planning.stage, fraction=planning.fraction)
    job.tell("planning", job.record.progress.model_dump())


def _note_step(door: Door, job: Job[EpisodeRecord], pick: EpisodePick) -> None:
    step = Step.of(pick, job.id, door.meshes)
    job.record.steps.append(step)
    job.record.ni, job.record.progress = pick.ni, None
    job.tell("pick", step.report.model_dump(mode="json"))
