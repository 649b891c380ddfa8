"""Keep processes running: start, stream their output, restart with a growing pause, stop all of them in time."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from medor_wire import child

FIRST_PAUSE_S = 0.2
LONGEST_PAUSE_S = 5.0
HEALTHY_S = 10.0
"""Having run this long, a process that ends is restarted after the first pause again."""
GRACE_S = 3.0
"""Between SIGTERM and SIGKILL."""
READ_S = 0.5
"""For the last words of a process that has ended."""
TICK_S = 0.05

Sink = Callable[[str, str], None]
"""Takes a process name and one line of its output."""


@dataclass
class Process:
    """One child process with its past. Only the supervisor's thread starts it."""

    name: str
    command: Sequence[str]
    environment: Mapping[str, str]
    folder: Path
    sink: Sink
    child: subprocess.Popen[str] | None = None
    reader: threading.Thread | None = None
    starts: int = 0
    exit_codes: list[int] = field(default_factory=list)
    """Of every run that has ended; negative for a signal."""
    started_at: float = 0.0
    """Of the present run, `time.monotonic` [s]."""
    due: float = 0.0
    pause_s: float = FIRST_PAUSE_S
    tail: deque[str] = field(default_factory=lambda: deque(maxlen=30))
    """The last lines of output, for error messages."""

    @property
    def pid(self) -> int | None:
        running = self.child
        return running.pid if running else None

    @property
    def alive(self) -> bool:
        running = self.child
        return running is not None and running.poll() is None

    def tend(self, now: float) -> None:
        """Start it when that is due; when it has ended, note so and plan the restart."""
        if self.child is None:
            if now >= self.due:
                self._start(now)
        elif (code := self.child.poll()) is not None:
            self._ended(code, now)

    def signal_group(self, number: signal.Signals) -> None:
        """Send a signal to the process and all that it started."""
        if self.child is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.child.pid, number)

    def _start(self, now: float) -> None:
        # Isolated (-I -S): the wrapper needs nothing but the standard library, and is gone after its exec.
        wrapper = [sys.executable, "-I", "-S", child.__file__, str(os.getpid())]
        self.child = subprocess.Popen(
            [*wrapper, *self.command],
            cwd=self.folder,
            env=dict(self.environment),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            process_group=0,
        )
        self.starts += 1
        self.started_at = now
        self.reader = threading.Thread(
            target=self._stream, args=(self.child,), name=f"output of {self.name}", daemon=True
        )
        self.reader.start()

    def _ended(self, code: int, now: float) -> None:
        self.signal_group(signal.SIGKILL)  # what it started must not outlive it
        self.child = None
        self.exit_codes.append(code)
        self.pause_s = FIRST_PAUSE_S if now - self.started_at >= HEALTHY_S else self.pause_s
        self.due = now + self.pause_s
        self._tell(f"ended with {describe(code)}; starting again in {self.pause_s:.1f} s")
        self.pause_s = min(2 * self.pause_s, LONGEST_PAUSE_S)

    def _stream(self, running: subprocess.Popen[str]) -> None:
        assert running.stdout is not None
        with running.stdout as output:
            for line in output:
                self._tell(line.rstrip("\n"))

    def _tell(self, line: str) -> None:
        self.tail.append(line)
        self.sink(self.name, line)


class Supervisor:
    """Keeps processes running from `start` to `stop`. One thread does it all, because Linux counts the death of
    the *thread* that started a child as the death of its parent."""

    def __init__(self, processes: Sequence[Process]) -> None:
        self.processes = {process.name: process for process in processes}
        self._stopping = threading.Event()
        self._now = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="supervisor", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End every process: SIGTERM, after `GRACE_S` SIGKILL. Returns when all are gone.

        Interrupted (a second Ctrl-C), it kills at once.
        """
        self._stopping.set()
        try:
            self._thread.join()
        except KeyboardInterrupt:
            self._now.set()
            self._thread.join()

    def _keep(self) -> None:
        while not self._stopping.wait(TICK_S):
            for process in self.processes.values():
                process.tend(time.monotonic())
        self._end()

    def _end(self) -> None:
        running = list(self.processes.values())
        for process in running:
            process.signal_group(signal.SIGTERM)
        deadline = time.monotonic() + GRACE_S
        while time.monotonic() < deadline and not self._now.is_set() and any(p.alive for p in running):
            time.sleep(TICK_S / 2)
        for process in running:
            process.signal_group(signal.SIGKILL)
            if process.child is not None:
                process.exit_codes.append(process.child.wait())
                process.child = None
            if process.reader is not None:
                process.reader.join(READ_S)


def describe(code: int) -> str:
    """An exit code in words: `code 1`, `SIGKILL`."""
    return f"code {code}" if code >= 0 else signal.Signals(-code).name
