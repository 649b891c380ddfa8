"""Rollouts of one plan's candidates, shared by all live dynamics instances.

The candidates are cut into chunks whose size does not depend on how many instances there are; every instance
takes the next chunk when it has answered the last one, so that a fast one does more of them. A chunk whose instance is
lost goes to another. When none is left to take, an instance rolls out again what another has not answered yet, and the
first answer counts: the slowest instance delays a plan by no more than a chunk of the fastest.
"""

import logging
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from medor_wire import endpoints
from medor_wire.bus import Bus, Instance
from medor_wire.errors import Busy, Cancelled, InternalError, MedorError, Unavailable
from medor_wire.messages import Message, RolloutProgress, RolloutRequest, Rollouts

log = logging.getLogger(__name__)

CHUNK = 10
"""Candidates per request: the work lost with an instance, small against a plan, large against a request."""
FAILURES = 3
"""An instance that fails so often in a row is not asked again in this plan; one that is only busy is."""
PAUSE_S = 0.2
"""Wait after a failure."""
GRACE_S = 1.0
"""How long a plan waits for a dynamics instance to come back once it has lost the last one."""


class Shooting:
    """One request's candidates on their way through the dynamics instances. Used once."""

    def __init__(self, bus: Bus, request: RolloutRequest, cancel: threading.Event, chunk: int = CHUNK) -> None:
        self._bus = bus
        self._request = request
        self._cancel = cancel
        count = len(request.picks)
        self._chunks = [slice(start, min(start + chunk, count)) for start in range(0, count, chunk)]
        self._waiting = deque(range(len(self._chunks)))
        self._running: Counter[int] = Counter()
        self._done = np.zeros(len(self._chunks), np.int64)
        self._replies: dict[int, Rollouts] = {}
        self._failure: BaseException | None = None
        self._stop = threading.Event()
        self._changed = threading.Condition()

    def rewards(self, on_fraction: Callable[[float], None]) -> NDArray[np.float64]:
        """(K,) rewards of all candidates, in their order; raises what `rollouts` does."""
        return self.rollouts(on_fraction)[1]

    def rollouts(self, on_fraction: Callable[[float], None]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Final vertices (K, V, 3) [m] and rewards (K,) of all candidates, in their order.

        Args:
            on_fraction: told the share of candidates rolled out, as it grows.

        Raises:
            Cancelled: `cancel` was set.
            Unavailable: no dynamics instance is left, and none came back.
            MedorError: what an instance answered to a chunk.
        """
        workers: dict[Instance, threading.Thread] = {}
        try:
            self._watch(workers, on_fraction)
        finally:
            self._stop.set()
            with self._changed:
                self._changed.notify_all()
        replies = [self._replies[i] for i in range(len(self._chunks))]
        return np.concatenate([it.positions for it in replies]), np.concatenate([it.rewards for it in replies])

    def _watch(self, workers: dict[Instance, threading.Thread], on_fraction: Callable[[float], None]) -> None:
        last_worked = -math.inf
        reported = -1
        while not self._finished:
            self._hire(workers)
            at_work = any(worker.is_alive() for worker in workers.values())
            if self._failure is not None:
                raise self._failure
            if self._cancel.is_set():
                raise Cancelled("planning was cancelled")
            if at_work:
                last_worked = time.monotonic()
            elif not self._finished and time.monotonic() - last_worked > GRACE_S:
                raise Unavailable(f"no dynamics instance left, {len(self._replies)} of {len(self._chunks)} chunks done")
            with self._changed:
                self._changed.wait(0.05)
                done = int(self._done.sum())
            if done > reported:
                reported = done
                on_fraction(done / len(self._request.picks))

    @property
    def _finished(self) -> bool:
        return len(self._replies) == len(self._chunks)

    def _hire(self, workers: dict[Instance, threading.Thread]) -> None:
        for instance in self._bus.instances(endpoints.ROLLOUT.service):
            if instance not in workers:
                workers[instance] = threading.Thread(
                    target=self._work, args=(instance,), name=f"shooting-{instance.id}", daemon=True
                )
                workers[instance].start()

    def _work(self, instance: Instance) -> None:
        """Take chunks until none is left, the plan has ended or the instance is lost."""
        failures = 0
        while failures < FAILURES and (index := self._take()) is not None:
            try:
                self._finish(index, self._ask(instance, index))
                failures = 0
            except (Unavailable, Cancelled) as lost:  # a process that leaves cancels what it runs
                if not self._stop.is_set():
                    log.warning("chunk %d of %d goes back: %s: %s", index, len(self._chunks), instance.id, lost)
                failures += not isinstance(lost, Busy)
                self._give_back(index)
                if instance not in self._bus.instances(instance.service):
                    return
                self._stop.wait(PAUSE_S)
            except MedorError as error:
                self._fail(error)
            except Exception as defect:
                log.exception("rollout of a chunk")
                self._fail(InternalError(f"{type(defect).__name__}: {defect}"))

    def _ask(self, instance: Instance, index: int) -> Rollouts:
        chunk = self._chunks[index]
        request = self._request.model_copy(
            update={"picks": self._request.picks[chunk], "places": self._request.places[chunk]}
        )

        def tell(progress: Message) -> None:
            if isinstance(progress, RolloutProgress):
                self._progress(index, progress.done)

        return self._bus.ask(
            endpoints.ROLLOUT,
            request,
            instance=instance,
            cancel=self._stop,
            on_progress=tell,
        )

    def _take(self) -> int | None:
        """A chunk nobody has begun, else one that others are at work on."""
        with self._changed:
            if self._finished or self._stop.is_set():
                return None
            index = self._waiting.popleft() if self._waiting else self._most_awaited()
            self._running[index] += 1
            return index

    def _most_awaited(self) -> int:
        """The unanswered chunk with the fewest instances at work on it, of these the least advanced."""
        unanswered = (index for index in range(len(self._chunks)) if index not in self._replies)
        return min(unanswered, key=lambda index: (self._running[index], self._done[index]))

    def _give_back(self, index: int) -> None:
        with self._changed:
            self._running[index] -= 1
            if not self._running[index] and index not in self._replies:
                self._done[index] = 0
                self._waiting.appendleft(index)
            self._changed.notify_all()

    def _progress(self, index: int, done: int) -> None:
        with self._changed:
            self._done[index] = max(self._done[index], done)
            self._changed.notify_all()

    def _finish(self, index: int, reply: Rollouts) -> None:
        with self._changed:
            self._running[index] -= 1
            self._replies.setdefault(index, reply)
            self._done[index] = len(reply.rewards)
            self._changed.notify_all()

    def _fail(self, failure: BaseException) -> None:
        with self._changed:
            self._failure = self._failure or failure
            self._stop.set()
            self._changed.notify_all()
