"""How far a collection has come: one living line on a terminal, a plain line every few seconds elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

EVERY_S = 10.0
"""Time between two plain lines [s]."""


class CollectionProgress:
    """Counts trajectories; the rate is that of this run, without what was there before.

    Args:
        total: Trajectories of the shard.
        found: How many of them were there before.
        console: Where to show it.
    """

    def __init__(self, total: int, found: int, console: Console | None = None) -> None:
        self.total = total
        self.found = found
        self.written = 0
        self._console = console or Console(stderr=True)
        self._began = self._shown = time.monotonic()
        columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn())
        self._bar = Progress(*columns, console=self._console) if self._console.is_terminal else None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
            self._bar.add_task("", total=self.total, completed=self.found, rate="")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None):
        if self._bar:
            self._bar.stop()
        self._console.print(self.line())

    def written_one(self, _: int = 0) -> None:
        """One more trajectory is on disk."""
        self.written += 1
        now = time.monotonic()
        if self._bar:
            self._bar.update(self._bar.task_ids[0], completed=self.found + self.written, rate=f"{self.per_hour:.0f}/h")
        elif now - self._shown >= EVERY_S:
            self._shown = now
            self._console.print(self.line())

    @property
    def per_hour(self) -> float:
        """Trajectories written an hour."""
        return self.written / max(time.monotonic() - self._began, 1e-9) * 3600

    def line(self) -> str:
        """The state in words."""
        done = self.found + self.written
        left = (self.total - done) / self.per_hour * 3600 if self.written else float("nan")
        eta = time.strftime("%H:%M:%S", time.gmtime(left)) if left == left else "?"
        return f"{done}/{self.total} trajectories, {self.per_hour:.0f}/h, {eta} left"
