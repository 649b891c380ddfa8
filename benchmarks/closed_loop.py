"""Episodes of the protocol in a cell, one after the other, each kept as soon as it has ended."""

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks import pictures
from benchmarks.pace import Pace
from benchmarks.protocol import Trial
from benchmarks.results import Line, Results
from benchmarks.skips import Skips, told
from medor_learn.revision import revision
from medor_wire import endpoints
from medor_wire.bus import Bus
from medor_wire.errors import (
    Busy,
    LeaseLost,
    MedorError,
    NoGarment,
    OutOfReach,
    ReconstructionFailed,
    SeveralGarments,
    Timeout,
    Unavailable,
)
from medor_wire.messages import Empty, EpisodePick, EpisodeProgress, EpisodeRequest, Message

ASK_AGAIN_S = 5.0
"""Between two questions to a busy cell [s]."""
GIVEN_UP = (NoGarment, OutOfReach, ReconstructionFailed, SeveralGarments)
"""What a method answers when it cannot go on. The episode counts with the NI it has reached."""

LOST = (LeaseLost, Timeout, Unavailable)
"""What becomes of an episode on a machine that has more to do than it can. It says nothing of the method."""


class ClosedLoop:
    """Runs trials in the cell of a bus.

    Args:
        folder: where results are kept, and pictures.
        tell: told where the run stands, a line at a time.
        patience_s: how long a busy cell is waited for [s].
    """

    def __init__(self, bus: Bus, folder: Path, tell: Callable[[str], None], patience_s: float = 1200.0) -> None:
        self._bus, self._folder, self._tell, self._patience_s = bus, folder, tell, patience_s
        self._commit = revision()

    def run(self, missing: Sequence[Trial], results: Results, skips: Skips) -> dict[str, str]:
        """Runs trials one after the other; why those that are not in the file now are not, by key.

        Trials that were lost are run once more, after all others.
        """
        pace, reasons, queue = Pace(results.lines()), {}, list(missing)
        for done, trial in enumerate(queue):  # which grows
            if reason := skips.reason(trial):
                reasons[trial.key] = reason
                continue
            left = pace.left(one for one in queue[done:] if skips.reason(one) is None)
            began = time.monotonic()
            try:
                results.append(self.episode(trial, f"[{done + 1}/{len(queue)}, {_minutes(left)}]"))
            except MedorError as error:
                lost = isinstance(error, LOST) and trial.key not in reasons
                if lost:
                    queue.append(trial)
                reasons[trial.key] = told(error)
                skips.refused(trial, error)
                over = f"; {trial.method} is left out for {trial.category}" if skips.reason(trial) else ""
                self._tell(f"{trial.key}  {told(error)}{'; once more later' if lost else over}")
            else:
                reasons.pop(trial.key, None)
                skips.works(trial)
                pace.add(trial, time.monotonic() - began)
        return reasons

    def episode(self, trial: Trial, standing: str) -> list[Line]:
        """The lines of one episode, start state included; its picture is kept.

        Args:
            trial: which.
            standing: told with every pick: where the run stands.

        Raises:
            MedorError: the cell refused or was lost.
        """
        steps: list[EpisodePick] = []
        clock = [time.perf_counter()]

        def report(message: Message) -> None:
            if isinstance(message, EpisodeProgress) and message.step is not None:
                steps.append(message.step)
                clock.append(time.perf_counter())
                self._tell(f"{standing} {trial.key}  pick {message.step.index}  NI {message.step.ni:.3f}")

        gave_up: dict[str, Any] = {}
        try:
            self._ask_when_free(trial.request(), report)
        except GIVEN_UP as error:
            if not steps:
                raise
            gave_up = {"gave_up": error.code}
            self._tell(f"{standing} {trial.key}  gives up: {told(error)}")
        self._picture(trial, steps)
        seconds = [after - before for before, after in pairwise(clock)]
        lines = [self._line(trial, *one) for one in zip(steps, seconds, strict=True)]
        lines[-1] |= {"last": True, **gave_up}
        return lines

    def _ask_when_free(self, request: EpisodeRequest, report: Callable[[Message], None]) -> None:
        """Asks for an episode. A cell that lost its asker, as a busy machine may, first finishes the one before."""
        began, told_so = time.monotonic(), False
        while True:
            try:
                self._bus.ask(endpoints.EPISODE, request, on_progress=report)
                return
            except Busy as busy:
                if time.monotonic() >= began + self._patience_s:
                    raise
                if not told_so:
                    self._tell(f"waiting until the cell is free ({told(busy)})")
                    told_so = True
                time.sleep(min(ASK_AGAIN_S, self._patience_s))

    def _line(self, trial: Trial, step: EpisodePick, seconds: float) -> Line:
        return {
            "key": trial.key,
            "method": trial.label,
            "category": trial.category,
            "task": trial.task,
            "state": trial.state,
            "pick": step.index,
            "ni": step.ni,
            "coverage_m2": step.coverage_m2,
            "no_op": step.no_op,
            "reward": step.reward,
            "no_op_reward": step.no_op_reward,
            "seconds": seconds,
            "timings_ms": step.timings_ms,
            "commit": self._commit,
            "last": False,
        }

    def _picture(self, trial: Trial, steps: Sequence[EpisodePick]) -> None:
        """What the camera saw before each pick, and what it sees now. An episode counts without it."""
        try:
            now = self._bus.ask(endpoints.CAPTURE, Empty())
        except MedorError as error:
            self._tell(f"no picture of {trial.key}: {told(error)}")
            return
        path = pictures.path(self._folder, trial.key)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pictures.strip([*(step.view for step in steps if step.view is not None), now]))


def _minutes(seconds: float | None) -> str:
    return "no telling how long" if seconds is None else f"{seconds / 60:.0f} min left"
