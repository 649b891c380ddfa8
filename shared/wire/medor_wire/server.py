"""Serving one endpoint: admission, a bounded pool of workers, deadlines, cancellation, errors as replies."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

from medor_wire import codec
from medor_wire.bus import Call
from medor_wire.endpoints import Endpoint
from medor_wire.envelope import Envelope
from medor_wire.errors import BadFrame, Busy, Cancelled, InternalError, MedorError, Unavailable
from medor_wire.messages import Message
from medor_wire.transport import Incoming

Observe = Callable[[str, str, float, str], None]
"""endpoint, request id, seconds in the service, outcome (`ok`, an error code, or `unsent`)."""


@dataclass(frozen=True)
class _Job:
    incoming: Incoming
    envelope: Envelope
    call: Call
    arrived: float


class Server:
    """Answers one endpoint with one handler."""

    def __init__(
        self,
        endpoint: Endpoint[Any, Any],
        handler: Callable[[Any, Call], Message],
        *,
        workers: int,
        queue: int,
        observe: Observe,
        defect: Callable[[str, str], None],
    ) -> None:
        self.endpoint = endpoint
        self._handler = handler
        self._capacity = workers + queue
        self._observe = observe
        self._defect = defect
        self._jobs: dict[str, _Job] = {}
        self._lock = threading.Lock()
        self._queue: SimpleQueue[_Job | None] = SimpleQueue()
        self._closed = False
        # Daemons, so that a stuck handler cannot keep a process from leaving.
        self._workers = [threading.Thread(target=self._work, name=endpoint.name, daemon=True) for _ in range(workers)]
        for worker in self._workers:
            worker.start()

    @property
    def busy(self) -> int:
        """Requests admitted and not yet answered."""
        return len(self._jobs)

    def offer(self, incoming: Incoming) -> None:
        """Admit or turn away. Runs on the network's thread: reads the envelope, never the frame, and never waits."""
        arrived = time.monotonic()
        try:
            envelope = Envelope.unpack(incoming.attachment)
            if incoming.size > codec.MAX_FRAME:
                raise BadFrame(f"{incoming.size} bytes, at most {codec.MAX_FRAME} are read")
            self._admit(incoming, envelope, arrived)
        except MedorError as error:
            self._observe(self.endpoint.name, "", time.monotonic() - arrived, error.code)
            incoming.fail(error)

    def withdraw(self, ask: str) -> None:
        """The asker of `ask` has cancelled."""
        if job := self._jobs.get(ask):
            job.call.withdraw()

    def close(self, timeout_s: float) -> None:
        """Cancel everything and wait for the handlers to notice."""
        with self._lock:
            self._closed = True
            jobs = list(self._jobs.values())
        for job in jobs:
            job.call.withdraw()
        for _ in self._workers:
            self._queue.put(None)
        deadline = time.monotonic() + timeout_s
        for worker in self._workers:
            if worker is not threading.current_thread():
                worker.join(max(0.0, deadline - time.monotonic()))

    def _admit(self, incoming: Incoming, envelope: Envelope, arrived: float) -> None:
        call = Call(envelope.request_id, envelope.deadline(), lambda message: incoming.progress(codec.encode(message)))
        job = _Job(incoming, envelope, call, arrived)
        with self._lock:
            if self._closed:
                raise self._leaving()
            if len(self._jobs) >= self._capacity:
                raise Busy(f"{self.endpoint.name} has {len(self._jobs)} requests, its limit")
            if envelope.ask in self._jobs:
                raise BadFrame(f"ask {envelope.ask} came twice")
            self._jobs[envelope.ask] = job
        self._queue.put(job)

    def _leaving(self) -> Unavailable:
        return Unavailable(f"{self.endpoint.name} is leaving the bus")

    def _work(self) -> None:
        while (job := self._queue.get()) is not None:
            try:
                outcome = self._answer(job)
            except Exception:  # the link is gone: there is nobody to tell, and other requests to answer
                self._defect(self.endpoint.name, job.call.request_id)
                outcome = "unsent"
            self._observe(self.endpoint.name, job.call.request_id, time.monotonic() - job.arrived, outcome)

    def _answer(self, job: _Job) -> str:
        """Run the handler and reply; the place is free again before the asker can know."""
        try:
            job.call.check()
            request = codec.decode(self.endpoint.request, job.incoming.frame())
            answer = codec.encode(self._handler(request, job.call))
            error = None
        except MedorError as raised:
            answer, error = b"", self._leaving() if self._closed and isinstance(raised, Cancelled) else raised
        except Exception:
            self._defect(self.endpoint.name, job.call.request_id)
            name, request_id = self.endpoint.name, job.call.request_id
            answer, error = b"", InternalError(f"a defect in {name}; the log of its service has request {request_id}")
        with self._lock:
            del self._jobs[job.envelope.ask]
        if error is None:
            job.incoming.reply(answer)
            return "ok"
        job.incoming.fail(error)
        return error.code
