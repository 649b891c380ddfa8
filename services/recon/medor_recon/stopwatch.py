"""How long the stages of a request took."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Stopwatch:
    """Milliseconds spent in named stages.

    Args:
        clock: seconds; wall time by default.
        on_stage: told the name of every stage as it begins.
    """

    def __init__(
        self, clock: Callable[[], float] = time.perf_counter, on_stage: Callable[[str], None] | None = None
    ) -> None:
        self.timings_ms: dict[str, float] = {}
        self._clock = clock
        self._on_stage = on_stage
        self._start = clock()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        if self._on_stage:
            self._on_stage(name)
        start = self._clock()
        yield
        self.timings_ms[name] = (self._clock() - start) * 1e3

    def total(self) -> dict[str, float]:
        """All timings [ms], `total` since this watch was made among them."""
        return {**self.timings_ms, "total": (self._clock() - self._start) * 1e3}
