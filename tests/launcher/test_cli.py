"""The command `medor` as a user runs it: up until Ctrl-C, nothing left however it ends; doctor tells the truth."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from medor_wire import doctor
from medor_wire.launcher import free_port

from .conftest import eventually, gone

MEDOR = [sys.executable, "-m", "medor_wire.cli"]


def end(process: subprocess.Popen[str], number: signal.Signals) -> float:
    """Seconds until `process` ends after a signal."""
    start = time.monotonic()
    process.send_signal(number)
    process.communicate(timeout=10)
    return time.monotonic() - start


@pytest.fixture
def running(cell_file: Path) -> Iterator[tuple[subprocess.Popen[str], str, list[int]]]:
    """`medor up` that says it is ready, its bus address and the processes it started."""
    command = [*MEDOR, "up", "--port", "0", "--router-port", "0"]
    environment = {**os.environ, "TMPDIR": str(cell_file.parent)}  # what a killed launcher cannot remove stays there
    with subprocess.Popen(command, cwd=cell_file.parent, env=environment, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if ready := re.search(r"ready after .*\(bus (\S+)\)", line):
                yield process, ready[1], [child.pid for child in psutil.Process(process.pid).children()]
                break
        process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_it_ends_within_five_seconds_and_leaves_nothing(running, number: signal.Signals) -> None:
    process, _, children = running
    assert len(children) == 3
    assert end(process, number) < 5
    assert process.returncode == 130
    assert all(gone(child) for child in children)


@pytest.mark.skipif(sys.platform != "linux", reason="PR_SET_PDEATHSIG")
def test_kill_dash_nine_leaves_nothing(running) -> None:
    process, _, children = running
    process.kill()
    eventually(lambda: all(gone(child) for child in children), seconds=2)


def test_a_taken_port_ends_it_with_one_clear_line(cell_file: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        done = subprocess.run([*MEDOR, "up", "--port", port], cwd=cell_file.parent, capture_output=True, text=True)
    assert done.returncode == 1
    assert re.fullmatch(rf"medor: port {port} .*--port\n", done.stderr)


def test_doctor_says_what_to_do_about_everything_that_is_not_well() -> None:
    command = [*MEDOR, "doctor", "--as-json", "--router", f"tcp/127.0.0.1:{free_port()}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parent)
    findings = {finding["subject"]: finding for finding in json.loads(done.stdout)}
    assert done.returncode == int(any(finding["state"] == "wrong" for finding in findings.values())), done.stdout
    assert all(finding["remedy"] for finding in findings.values() if finding["state"] != "ok")
    assert findings["cell"]["remedy"] == "start one: medor up"
    assert findings["cores"]["found"] == str(os.cpu_count())
    assert findings["medor_recon.serve"]["state"] == "ok"


def test_doctor_notices_what_is_missing() -> None:
    broken = doctor.importable("medor_recon.no_such_module")
    assert (broken.state, "no_such_module" in broken.found) == ("wrong", True)
    (absent,) = doctor.packages(["no-such-package-at-all"])
    assert (absent.state, absent.remedy) == ("wrong", "make setup")


def test_doctor_tells_a_cell_from_a_stranger_on_the_port() -> None:
    (free,) = doctor.door(free_port())
    assert (free.state, free.found) == ("ok", "free")
    with socket.create_server(("127.0.0.1", 0)) as stranger:
        (taken,) = doctor.door(stranger.getsockname()[1])
    assert taken.state == "note"
    assert "--port" in taken.remedy


def test_doctor_finds_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    assert doctor.writable(tmp_path / "new" / "folder")
    (tmp_path / "file").touch()
    assert not doctor.writable(tmp_path / "file" / "folder")
