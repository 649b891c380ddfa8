"""The supervisor with real, tiny child processes: what dies comes back, what is stopped is gone, nothing is left."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from medor_wire import supervisor
from medor_wire.supervisor import LONGEST_PAUSE_S, Process, Supervisor

from .conftest import eventually, gone

QUIET = "import time; print('up', flush=True); time.sleep(60)"
STUBBORN = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('up', flush=True); time.sleep(60)"
PARENT = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {QUIET!r}]).wait()"

Keep = Callable[..., Supervisor]


@pytest.fixture
def lines() -> list[tuple[str, str]]:
    return []


@pytest.fixture
def keep(tmp_path: Path, lines: list[tuple[str, str]]) -> Iterator[Keep]:
    """Starts a supervisor over one process per script, named a, b, …"""
    started: list[Supervisor] = []

    def keep(*scripts: str) -> Supervisor:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        processes = [
            Process(name, [sys.executable, "-c", script], environment, tmp_path, lambda *line: lines.append(line))
            for name, script in zip("abc", scripts, strict=False)
        ]
        started.append(Supervisor(processes))
        started[-1].start()
        return started[-1]

    yield keep
    for one in started:
        one.stop()


def test_output_carries_the_name_of_the_process(keep: Keep, lines: list[tuple[str, str]]) -> None:
    keep("print('one')\nimport sys; print('two', file=sys.stderr)\nimport time; time.sleep(60)", QUIET)
    eventually(lambda: {("a", "one"), ("a", "two"), ("b", "up")} <= set(lines))


def test_a_killed_process_comes_back_and_its_neighbour_is_left_alone(keep: Keep, lines: list) -> None:
    processes = keep(QUIET, QUIET).processes
    eventually(lambda: len(lines) == 2)
    killed, neighbour = processes["a"].pid, processes["b"].pid
    assert killed is not None
    os.kill(killed, signal.SIGKILL)
    eventually(lambda: processes["a"].starts == 2 and processes["a"].alive)
    assert processes["a"].exit_codes == [-signal.SIGKILL]
    assert processes["a"].pid != killed
    assert processes["b"].pid == neighbour
    assert ("a", "ended with SIGKILL; starting again in 0.2 s") in lines


def test_the_pause_doubles_up_to_its_limit(tmp_path: Path) -> None:
    process = Process("a", [sys.executable, "-c", "raise SystemExit(3)"], dict(os.environ), tmp_path, lambda *_: None)
    now, pauses = 0.0, []
    for _ in range(7):
        process.tend(now)
        assert process.child is not None
        process.child.wait()
        process.tend(now)
        assert process.child is None
        pauses.append(process.due - now)
        process.tend(process.due - 0.001)
        assert process.child is None, "started before it was due"
        now = process.due
    assert pauses == pytest.approx([0.2, 0.4, 0.8, 1.6, 3.2, LONGEST_PAUSE_S, LONGEST_PAUSE_S])
    assert process.exit_codes == [3] * 7


def test_a_process_that_ran_long_enough_is_forgiven(tmp_path: Path) -> None:
    process = Process("a", [sys.executable, "-c", "pass"], dict(os.environ), tmp_path, lambda *_: None, pause_s=3.2)
    process.tend(0.0)
    assert process.child is not None
    process.child.wait()
    process.tend(supervisor.HEALTHY_S)
    assert process.due - supervisor.HEALTHY_S == pytest.approx(supervisor.FIRST_PAUSE_S)


def test_stopping_ends_all_with_a_polite_signal(keep: Keep, lines: list) -> None:
    kept = keep(QUIET, QUIET)
    eventually(lambda: len(lines) == 2)
    pids = [process.pid for process in kept.processes.values()]
    kept.stop()
    assert all(pid is not None and gone(pid) for pid in pids)
    assert [process.exit_codes for process in kept.processes.values()] == [[-signal.SIGTERM]] * 2


def test_what_ignores_the_polite_signal_is_killed(keep: Keep, lines: list, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervisor, "GRACE_S", 0.3)
    kept = keep(STUBBORN)
    eventually(lambda: lines)
    start = time.monotonic()
    kept.stop()
    assert 0.3 <= time.monotonic() - start < 2
    assert kept.processes["a"].exit_codes == [-signal.SIGKILL]


def test_children_of_children_are_ended_too(keep: Keep, lines: list) -> None:
    kept = keep(PARENT)
    eventually(lambda: lines)
    pid = kept.processes["a"].pid
    assert pid is not None
    grandchildren = [child.pid for child in psutil.Process(pid).children(recursive=True)]
    assert grandchildren
    os.kill(pid, signal.SIGKILL)
    eventually(lambda: all(gone(child) for child in grandchildren))


@pytest.mark.skipif(sys.platform != "linux", reason="PR_SET_PDEATHSIG")
@pytest.mark.parametrize("script", [QUIET, STUBBORN], ids=["quiet", "stubborn"])
def test_no_orphan_when_the_supervisor_itself_is_killed(tmp_path: Path, script: str) -> None:
    program = f"""
        import sys, time
        from pathlib import Path
        from medor_wire.supervisor import Process, Supervisor
        process = Process("a", [sys.executable, "-c", {script!r}], {{}}, Path({str(tmp_path)!r}), lambda *_: None)
        kept = Supervisor([process])
        kept.start()
        while not process.tail: time.sleep(0.01)
        print(process.pid, flush=True)
        time.sleep(60)
    """
    with subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)], stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert not gone(child)
        parent.kill()
        eventually(lambda: gone(child))
