"""Run a whole cell without containers: host the router, start what compose.yaml says, keep it running, stop it.

with Launcher(profile="sim") as cell:
    cell.wait_ready(timeout=300)
    httpx.get(f"{cell.url}/readyz")
"""

import http.client
import os
import shutil
import signal
import socket
import sys
import time
import urllib.request
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import gettempdir
from typing import Self

from medor_wire import compose
from medor_wire.bus import Bus, join
from medor_wire.config import Settings
from medor_wire.output import Output
from medor_wire.router import routing
from medor_wire.supervisor import Process, Supervisor, describe

LOOPBACK = "127.0.0.1"
ROUTER = "router"
DOOR = "gateway"
HOPELESS = 3
"""A process that ended this often without ever having been ready will not come up by itself."""
FRESH_S = 3.0
"""A heartbeat older than this says nothing about now."""


class CellError(RuntimeError):
    """The cell cannot be brought up; the message says what to do."""


def heed_signals() -> None:
    """Make SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt in this process, so that its cells end with it.

    SIGINT too: shells make background jobs ignore it.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)


class Launcher:
    """One cell on this machine, running between `start` and `stop` (or as a context manager).

    Attributes:
        url: of the HTTP door.
        router: Zenoh endpoint every service connects to.
        processes: by name; replicas are `dynamics-1`, `dynamics-2`, …
        bus: of the launcher itself, while the cell runs.
    """

    def __init__(
        self,
        profile: str = "sim",
        *,
        port: int = 0,
        router_port: int = 0,
        file: Path | None = None,
        environment: Mapping[str, str] | None = None,
        logs: Path = Path("runs/logs"),
        echo: bool = True,
    ) -> None:
        """Reads compose.yaml and settles the addresses; starts nothing yet.

        Args:
            profile: of compose.yaml, `sim` or `robot`.
            port: of the HTTP door; 0 takes a free one.
            router_port: 0 takes a free one.
            file: compose.yaml; found from the working directory when absent.
            environment: added to this process's own for every service.
            logs: folder for one log file per process, relative to compose.yaml.
            echo: show the services' output on the terminal.

        Raises:
            CellError: a port is taken.
            compose.ComposeError: compose.yaml cannot be used.
        """
        file = file or compose.find()
        self.profile = profile
        self.port = port or free_port()
        self.router = f"tcp/{LOOPBACK}:{router_port or free_port()}"
        self.url = f"http://{LOOPBACK}:{self.port}"
        require_free(self.port, "--port")
        require_free(int(self.router.rpartition(":")[2]), "--router-port")
        given = {**os.environ, **(environment or {})}
        addresses = {"router": self.router, "id": "", "metrics_port": 0}
        self._config = Settings.from_environment(given).bus.model_copy(update=addresses)
        # What this cell's processes remember between their restarts, and no other cell shares.
        self._state = Path(gettempdir()) / f"medor-{os.getpid()}-{self.port}"
        services = compose.read(file, {**given, "MEDOR_STATE": str(self._state)})
        self.output = Output(file.parent / logs, echo=echo)
        self._supervisor = Supervisor(
            [
                self._process(replica, given, file.parent)
                for replica in compose.replicas(services, profile)
                if replica.service != ROUTER
            ]
        )
        self.processes = self._supervisor.processes
        self.bus: Bus
        self._open = ExitStack()

    def _process(self, replica: compose.Replica, given: Mapping[str, str], folder: Path) -> Process:
        addresses = {
            "MEDOR_BUS__ROUTER": self.router,
            "MEDOR_BUS__ID": replica.name,
            "MEDOR_BUS__METRICS_PORT": "0",
            "MEDOR_GATEWAY__HOST": LOOPBACK,
            "MEDOR_GATEWAY__PORT": str(self.port),
            "PYTHONUNBUFFERED": "1",
        }
        program, *arguments = replica.command
        command = [sys.executable if program == "python" else program, *arguments]
        environment = {"MEDOR_BUS__LOG": "console", **given, **replica.environment, **addresses}
        return Process(replica.name, command, environment, folder, self.output.line)

    def start(self) -> Self:
        """Starts the router and every process; does not wait for them."""
        with ExitStack() as opened:
            self._state.mkdir(mode=0o700)
            opened.callback(shutil.rmtree, self._state, ignore_errors=True)
            opened.enter_context(self.output)
            opened.enter_context(routing(self.router, self._config))
            self.bus = opened.enter_context(join("launcher", self._config))
            self._supervisor.start()
            opened.callback(self._supervisor.stop)
            self._open = opened.pop_all()
        return self

    def stop(self) -> None:
        """Ends every process, then the router. At most five seconds; nothing is left behind."""
        self._open.close()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def waiting_for(self) -> dict[str, str]:
        """The processes that are not ready, with what is known about each; empty when the cell is ready."""
        beats = {beat.id: beat for beat in self.bus.health().values()}
        found = {}
        for name, process in self.processes.items():
            beat = beats.get(name)
            if not process.alive:
                found[name] = "restarting" if process.exit_codes else "starting"
            elif beat is None or beat.age_s > min(FRESH_S, time.monotonic() - process.started_at):
                found[name] = "starting"
            elif not beat.ready:
                found[name] = beat.detail or "warming up"
        if not found and DOOR in self.processes and not self._open_door():
            found[DOOR] = "looking for the others"
        return found

    def _open_door(self) -> bool:
        """Whether the gateway answers that all it needs is there."""
        try:
            with urllib.request.urlopen(f"{self.url}/readyz", timeout=2) as answer:
                return answer.status == 200
        except (OSError, http.client.HTTPException):
            return False

    def wait_ready(self, timeout: float = 300.0) -> float:
        """Blocks until every process says it is ready, showing progress. Returns the seconds waited.

        Raises:
            CellError: one keeps ending, or the time is over; with its last words.
        """
        start = time.monotonic()
        with self.output.progress() as show:
            while waiting := self.waiting_for():
                elapsed = time.monotonic() - start
                hopeless = [name for name in waiting if len(self.processes[name].exit_codes) >= HOPELESS]
                if hopeless or elapsed > timeout:
                    raise CellError(self._last_words(hopeless or list(waiting), elapsed))
                ready = len(self.processes) - len(waiting)
                show(f"{ready}/{len(self.processes)} ready, waiting for {listed(waiting)}")
                time.sleep(0.05)
        return time.monotonic() - start

    def _last_words(self, names: list[str], elapsed: float) -> str:
        words = [f"not ready after {elapsed:.0f} s: {', '.join(names)}"]
        for name in names:
            process = self.processes[name]
            ends = f" (ended with {describe(process.exit_codes[-1])})" if process.exit_codes else ""
            words += [f"--- {name}{ends}, last lines:", *list(process.tail)[-12:]]
        return "\n".join([*words, f"all logs: {self.output.folder}"])


def listed(waiting: Mapping[str, str]) -> str:
    """`recon (loading), sim (starting)`."""
    return ", ".join(f"{name} ({state})" for name, state in waiting.items())


def free_port() -> int:
    """A TCP port of the loopback interface that nobody listens on now."""
    with socket.create_server((LOOPBACK, 0)) as listener:
        return listener.getsockname()[1]


def is_free(port: int) -> bool:
    """Whether nobody listens on this TCP port of the loopback interface."""
    try:
        socket.create_server((LOOPBACK, port)).close()
    except OSError:
        return False
    return True


def require_free(port: int, option: str) -> None:
    """Raises `CellError` when something listens on `port` of the loopback interface."""
    if not is_free(port):
        raise CellError(f"port {port} of {LOOPBACK} is taken: stop what listens there, or choose another with {option}")
