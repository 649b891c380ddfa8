"""How far a training run has come: one living line on a terminal, a plain line now and then elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

EVERY_S = 30.0
"""Time between two plain lines [s]."""


class TrainingProgress:
    """Shows the share of the run that is over, and when it will be.

    Args:
        done: share that was over before this run went on.
        console: where to show it.
    """

    def __init__(self, done: float, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._first = done
        self._began = time.monotonic()
        self._shown = self._began
        columns = (BarColumn(), TextColumn("{task.description}"))
        self._bar = Progress(*columns, console=self._console) if self._console.is_terminal else None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
            self._bar.update(self._bar.add_task("", total=1.0), completed=self._first)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None):
        if self._bar:
            self._bar.stop()

    def update(self, step: int, done: float, loss: float) -> None:
        """One more step."""
        now = time.monotonic()
        if self._bar:
            self._bar.update(self._bar.task_ids[0], completed=done, description=self.line(step, done, loss))
        elif now - self._shown >= EVERY_S:
            self._shown = now
            self.say(self.line(step, done, loss))

    def line(self, step: int, done: float, loss: float) -> str:
        """The state in words."""
        left = (1 - done) / max(done - self._first, 1e-9) * (time.monotonic() - self._began)
        return f"step {step}, {done:.1%}, loss {loss:.4f}, {_clock(left)} left"

    def say(self, line: str) -> None:
        """A line that stays."""
        self._console.print(line, soft_wrap=True, highlight=False)


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(min(seconds, 3.6e6)), 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}"
