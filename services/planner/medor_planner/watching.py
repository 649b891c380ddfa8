"""What a plan tells its asker while it runs, and how the asker's cancel reaches the questions it asks."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal

from medor_wire.bus import Call
from medor_wire.errors import Cancelled
from medor_wire.messages import PlanProgress

POLL_S = 0.05

Stage = Literal["capture", "reconstruct", "goals", "sample", "screen", "rollout", "judge"]


class Stages:
    """Progress and time of a plan's stages, one after another."""

    def __init__(self, call: Call, tell: Callable[[PlanProgress], None]) -> None:
        self._call = call
        self._tell = tell
        self._start = time.perf_counter()
        self.timings_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: Stage) -> Iterator[None]:
        """The block is part of a stage; one that comes again adds to its time."""
        self._call.check()
        self.report(name, 0.0)
        start = time.perf_counter()
        yield
        self.timings_ms[name] = self.timings_ms.get(name, 0.0) + 1e3 * (time.perf_counter() - start)
        self.report(name, 1.0)

    def report(self, name: Stage, fraction: float) -> None:
        self._tell(PlanProgress(stage=name, fraction=fraction))

    def total(self) -> dict[str, float]:
        """All timings [ms], `total` among them."""
        return {**self.timings_ms, "total": 1e3 * (time.perf_counter() - self._start)}


@contextmanager
def cancelling(call: Call) -> Iterator[threading.Event]:
    """An event that is set when the call is cancelled or its deadline passes.

    Leaving with `Cancelled` because of it raises what the call itself says: `Cancelled` or `Timeout`.
    """
    cancel, over = threading.Event(), threading.Event()

    def watch() -> None:
        while not over.wait(POLL_S):
            if call.cancelled():
                cancel.set()
                return

    watcher = threading.Thread(target=watch, name="cancelling", daemon=True)
    watcher.start()
    try:
        yield cancel
    except Cancelled:
        call.check()
        raise
    finally:
        over.set()
        watcher.join()
