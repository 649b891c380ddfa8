"""Work that outlives its HTTP request: one thread per job, an event log to follow, cancel, bounded memory."""

import asyncio
import contextvars
import threading
import uuid
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

from medor_gateway.problem import Problem, problem_of
from medor_wire import logs
from medor_wire.errors import Busy, Cancelled, InternalError, MedorError, NotFound

Record = TypeVar("Record")
Status = Literal["running", "done", "failed", "cancelled"]


@dataclass(frozen=True)
class Event:
    """Something that happened in a job; ids count from 1."""

    id: int
    name: str
    data: dict[str, Any]


class Job(Generic[Record]):
    """One piece of work and what became of it so far. `record` is the owner's: what the work found."""

    def __init__(self, record: Record) -> None:
        self.id = uuid.uuid4().hex[:16]
        self.record = record
        self.names = {self.id}
        """Every id under which the job may be found."""
        self.status: Status = "running"
        self.error: MedorError | None = None
        self.problem: Problem | None = None
        """The same, to show; it names the request that began the job."""
        self.cancel = threading.Event()
        """Set by whoever wants the work to stop."""
        self.ended = threading.Event()
        self._events: list[Event] = []
        self._lock = threading.Lock()
        self._followers: set[Callable[[], object]] = set()

    def tell(self, name: str, data: dict[str, Any]) -> None:
        """Append an event to the log."""
        with self._lock:
            self._events.append(Event(len(self._events) + 1, name, data))
        self._wake()

    def events(self, after: int = 0) -> tuple[list[Event], bool]:
        """Events with an id greater than `after`, and whether more may come."""
        with self._lock:
            return self._events[max(after, 0) :], self.status == "running"

    async def follow(self, after: int = 0) -> AsyncIterator[Event]:
        """Events with an id greater than `after` as they happen, until the job has ended."""
        loop, woken = asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            with suppress(RuntimeError):  # the loop of a follower that is gone is closed
                loop.call_soon_threadsafe(woken.set)

        self._followers.add(wake)
        try:
            more = True
            while more:
                woken.clear()
                fresh, more = self.events(after)
                for event in fresh:
                    after = event.id
                    yield event
                if more:
                    await woken.wait()
        finally:
            self._followers.discard(wake)

    def run(self, work: Callable[["Job[Record]"], object]) -> None:
        """Do the work; whatever it raises becomes the job's error."""
        try:
            work(self)
        except Cancelled as error:
            self._end("cancelled", error)
        except MedorError as error:
            self._end("failed", error)
        except Exception:
            logs.defect("job", self.id)
            self._end("failed", InternalError("a defect in the gateway; the traceback is in its log"))
        else:
            self._end("done", None)

    def _end(self, status: Status, error: MedorError | None) -> None:
        data = {"status": status, "code": error and error.code, "detail": error and str(error)}
        with self._lock:
            self.problem = error and problem_of(error)
            self._events.append(Event(len(self._events) + 1, "end", data))
            self.status, self.error = status, error
        self.ended.set()
        self._wake()

    def _wake(self) -> None:
        for wake in tuple(self._followers):
            wake()


class Jobs(Generic[Record]):
    """At most `running` jobs at once; the newest `kept` ended ones are remembered."""

    def __init__(self, running: int, kept: int) -> None:
        self._running = running
        self._kept = kept
        self._jobs: dict[str, Job[Record]] = {}
        self._lock = threading.Lock()

    def start(self, record: Record, work: Callable[[Job[Record]], object]) -> Job[Record]:
        """Begin `work` in its own thread.

        Raises:
            Busy: as many jobs as allowed are running.
        """
        job = Job(record)
        with self._lock:
            ended = [known for known in self._jobs.values() if known.status != "running"]
            if len(self._jobs) - len(ended) >= self._running:
                raise Busy(f"expected fewer than {self._running} jobs running, all are taken")
            for old in ended[: max(0, len(ended) - self._kept + 1)]:
                del self._jobs[old.id]
            self._jobs[job.id] = job
        context = contextvars.copy_context()  # still on behalf of the request
        threading.Thread(target=lambda: context.run(job.run, work), name=f"job-{job.id}", daemon=True).start()
        return job

    def find(self, name: str) -> Job[Record]:
        """The job known under an id.

        Raises:
            NotFound: never heard of, or so long ago that it is forgotten.
        """
        for job in self.newest():
            if name in job.names:
                return job
        raise NotFound(f"expected the id of a recent job, got {name!r}")

    def newest(self) -> list[Job[Record]]:
        """All remembered jobs, newest first."""
        with self._lock:
            return list(self._jobs.values())[::-1]

    def running(self) -> int:
        """How many jobs run now."""
        return sum(job.status == "running" for job in self.newest())

    def close(self, patience_s: float = 2.0) -> None:
        """Cancel what runs and give it a moment to end."""
        running = [job for job in self.newest() if job.status == "running"]
        for job in running:
            job.cancel.set()
        for job in running:
            job.ended.wait(patience_s / len(running))
