"""Who is on the bus, and whom to ask next."""

import math
import threading
import time
from collections.abc import Callable, Collection
from queue import SimpleQueue

from medor_wire import logs
from medor_wire.bus import Instance
from medor_wire.errors import Unavailable

FORGIVE_S = 5.0
"""An instance that did not answer is asked last for this long."""


class Peers:
    """Live instances by presence, and when each was last asked and last failed."""

    def __init__(self) -> None:
        self._alive: set[Instance] = set()
        self._asked: dict[Instance, float] = {}
        self._failed: dict[Instance, float] = {}
        self._changed = threading.Condition()
        self._events: SimpleQueue[tuple[Callable[[Instance, bool], None], Instance, bool] | None] = SimpleQueue()
        self._callbacks: list[Callable[[Instance, bool], None]] = []
        threading.Thread(target=self._tell, name="presence", daemon=True).start()

    def update(self, instance: Instance, alive: bool) -> None:
        """Presence came or went. Runs on the network's thread."""
        with self._changed:
            if (instance in self._alive) == alive:
                return
            (self._alive.add if alive else self._alive.discard)(instance)
            if not alive:
                self._asked.pop(instance, None)
                self._failed.pop(instance, None)
            for callback in self._callbacks:
                self._events.put((callback, instance, alive))
            self._changed.notify_all()

    def watch(self, callback: Callable[[Instance, bool], None]) -> None:
        """Call back for those present now and for every change, in one thread, in order."""
        with self._changed:
            self._callbacks.append(callback)
            for instance in sorted(self._alive):
                self._events.put((callback, instance, True))

    def of(self, service: str) -> list[Instance]:
        with self._changed:
            return sorted(instance for instance in self._alive if instance.service == service)

    def pick(self, service: str, avoid: Collection[Instance], wait_s: float) -> Instance:
        """The live instance of `service` longest not asked; those in `avoid` or failed lately come last.

        Raises:
            Unavailable: there is none within `wait_s`.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: any(i.service == service for i in self._alive), wait_s):
                raise Unavailable(f"nobody serves {service}")
            now = time.monotonic()
            candidates = sorted(i for i in self._alive if i.service == service)
            chosen = min(
                candidates, key=lambda i: (i in avoid, self._distrusted(i, now), self._asked.get(i, -math.inf))
            )
            self._asked[chosen] = now
            return chosen

    def _distrusted(self, instance: Instance, now: float) -> bool:
        return now - self._failed.get(instance, -math.inf) < FORGIVE_S

    def failed(self, instance: Instance) -> None:
        with self._changed:
            if instance in self._alive:
                self._failed[instance] = time.monotonic()

    def close(self) -> None:
        self._events.put(None)

    def _tell(self) -> None:
        while (event := self._events.get()) is not None:
            callback, instance, alive = event
            try:
                callback(instance, alive)
            except Exception:
                logs.defect("presence", instance.presence)
