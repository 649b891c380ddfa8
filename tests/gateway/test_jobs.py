import asyncio
import threading

import pytest

from medor_gateway.jobs import Event, Job, Jobs
from medor_wire.errors import Busy, Cancelled, InternalError, NoGarment, NotFound


def finished(jobs: Jobs, work=lambda job: None) -> Job:
    job = jobs.start(None, work)
    assert job.ended.wait(2)
    return job


async def gather(job: Job, after: int = 0) -> list[Event]:
    return [event async for event in job.follow(after)]


def fail(error: Exception):
    def work(job: Job) -> None:
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "status", "kind"),
    [
        (NoGarment("bare table"), "failed", NoGarment),
        (Cancelled("enough"), "cancelled", Cancelled),
        (ZeroDivisionError("secret"), "failed", InternalError),
    ],
)
def test_how_the_work_ends_is_how_the_job_ends(error: Exception, status: str, kind: type) -> None:
    job = finished(Jobs(1, 1), fail(error))
    assert job.status == status
    assert isinstance(job.error, kind)
    assert "secret" not in str(job.error)
    [end] = job.events()[0]
    assert (end.name, end.data["status"], end.data["code"]) == ("end", status, kind.code)


def test_followers_hear_everything_once_and_in_order() -> None:
    ready = threading.Barrier(4)

    def work(job: Job) -> None:
        ready.wait(2)
        for number in range(200):
            job.tell("count", {"n": number})

    job = Jobs(1, 1).start(None, work)
    heard: list[list[Event]] = []

    def follow() -> None:
        ready.wait(2)
        heard.append(asyncio.run(gather(job)))

    followers = [threading.Thread(target=follow) for _ in range(3)]
    for follower in followers:
        follower.start()
    for follower in followers:
        follower.join(5)
    assert len(heard) == 3
    for events in heard:
        assert [event.id for event in events] == list(range(1, 202))
        assert [event.data["n"] for event in events[:-1]] == list(range(200))


@pytest.mark.parametrize("after", [-5, 0, 1, 3, 99])
def test_a_late_follower_goes_on_where_it_was(after: int) -> None:
    job = finished(Jobs(1, 1), lambda job: [job.tell("x", {}) for _ in range(3)])
    assert [event.id for event in asyncio.run(gather(job, after))] == [i for i in (1, 2, 3, 4) if i > after]


def test_no_more_run_at_once_than_allowed() -> None:
    jobs, go = Jobs(2, 5), threading.Event()
    running = [jobs.start(None, lambda job: go.wait(2)) for _ in range(2)]
    with pytest.raises(Busy):
        jobs.start(None, lambda job: None)
    go.set()
    for job in running:
        assert job.ended.wait(2)
    assert finished(jobs).status == "done"


def test_the_oldest_ended_jobs_are_forgotten() -> None:
    jobs = Jobs(1, 3)
    done = [finished(jobs) for _ in range(10)]
    assert jobs.newest() == done[:-4:-1]
    with pytest.raises(NotFound):
        jobs.find(done[0].id)


def test_a_running_job_is_never_forgotten() -> None:
    jobs, go = Jobs(2, 1), threading.Event()
    running = jobs.start(None, lambda job: go.wait(5))
    for _ in range(5):
        finished(jobs)
    assert jobs.find(running.id) is running
    go.set()


def test_closing_cancels_what_runs() -> None:
    def work(job: Job) -> None:
        assert job.cancel.wait(5)
        raise Cancelled("told to")

    jobs = Jobs(2, 2)
    running = [jobs.start(None, work) for _ in range(2)]
    jobs.close()
    assert [job.status for job in running] == ["cancelled", "cancelled"]
