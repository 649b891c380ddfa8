"""The launcher with fake services on a real bus: it knows who is ready, brings back who is lost, says who cannot."""

import os
import re
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from medor_wire import doctor
from medor_wire.launcher import CellError, Launcher, free_port

from .conftest import eventually, gone, write_cell


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    with Launcher(file=write_cell(tmp_path_factory.mktemp("cell")), echo=False) as cell:
        cell.wait_ready(20)
        yield cell


def test_every_process_of_the_profile_is_ready(cell: Launcher) -> None:
    assert list(cell.processes) == ["eye-1", "eye-2", "hand"]
    assert cell.waiting_for() == {}
    assert {"eye-1", "eye-2", "hand"} <= {health.id for health in cell.bus.health().values() if health.ready}


def test_output_is_kept_in_one_file_per_process(cell: Launcher) -> None:
    for name in cell.processes:
        assert "serving" in (cell.output.folder / f"{name}.log").read_text()


def test_a_killed_process_is_missed_at_once_and_ready_again_without_help(cell: Launcher) -> None:
    pid = cell.processes["hand"].pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    eventually(lambda: list(cell.waiting_for()) == ["hand"], seconds=1)
    eventually(lambda: cell.waiting_for().get("hand") == "compiling", seconds=5)
    eventually(lambda: not cell.waiting_for(), seconds=5)
    assert cell.processes["hand"].pid != pid


def test_doctor_sees_who_is_ready_and_who_is_missing(cell: Launcher) -> None:
    findings = {finding.subject: finding for finding in doctor.cell(cell.router)}
    states = {name.rpartition("/")[2]: finding.state for name, finding in findings.items()}
    assert states["eye-1"] == states["eye-2"] == states["hand"] == "ok"
    assert findings["planner"].state == "wrong"
    assert findings["planner"].found == "nobody serves it"


def test_a_second_cell_runs_beside_the_first(cell: Launcher, cell_file: Path) -> None:
    with Launcher("sim", file=cell_file, echo=False) as other:
        other.wait_ready(20)
        assert other.router != cell.router
        assert other.url != cell.url
        pids = [process.pid for process in other.processes.values()]
    assert all(pid is not None and gone(pid) for pid in pids)
    assert cell.waiting_for() == {}


def test_a_taken_port_is_refused_with_what_to_do(cell_file: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(CellError, match=rf"port {port} .* taken: stop .*, or choose another with --port"):
            Launcher(port=port, file=cell_file)
        with pytest.raises(CellError, match="--router-port"):
            Launcher(router_port=port, file=cell_file)


def test_state_is_private_to_the_cell_and_gone_with_it(tmp_path: Path) -> None:
    ledger = "environment: {LEDGER: '${MEDOR_STATE:-runs}/ledger'}"
    keeper = f"services: {{eye: {{command: [python, fake.py], profiles: [sim], {ledger}}}}}"
    file = write_cell(tmp_path, keeper, "import os; open(os.environ['LEDGER'], 'x'); print(os.environ['LEDGER'])")
    kept = []
    for _ in range(2):
        with Launcher(file=file, echo=False) as cell:
            eventually(lambda cell=cell: cell.processes["eye"].tail)
            kept.append(Path(cell.processes["eye"].tail[0]))
            assert kept[-1].exists()
    assert kept[0] != kept[1]
    assert not any(path.parent.exists() for path in kept)


def test_free_ports_are_free() -> None:
    with socket.create_server(("127.0.0.1", free_port())):
        pass


def test_a_hopeless_service_is_reported_with_its_last_words(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    broken = "services: {eye: {command: [python, fake.py], profiles: [sim]}}"
    file = write_cell(tmp_path, broken, "raise SystemExit('no weights in weights/recon')")
    with Launcher(file=file, echo=True) as cell, pytest.raises(CellError) as raised:
        cell.wait_ready(20)
    assert "eye (ended with code 1)" in str(raised.value)
    assert "no weights in weights/recon" in str(raised.value)
    assert re.search(r"^ +eye \| no weights in weights/recon$", capfd.readouterr().err, re.MULTILINE)


def test_what_never_gets_ready_is_named_when_time_is_up(tmp_path: Path) -> None:
    slow = "services: {router: {command: [x]}, eye: {command: [python, fake.py], profiles: [sim]}}"
    file = write_cell(tmp_path, slow, "import time; time.sleep(60)")
    with Launcher(file=file, echo=False) as cell, pytest.raises(CellError, match="not ready after 1 s: eye"):
        cell.wait_ready(0.6)


def test_services_are_handed_loopback_addresses(tmp_path: Path) -> None:
    told = """
        import os
        print({name: value for name, value in sorted(os.environ.items()) if name.startswith("MEDOR_")})
    """
    containers = """
        x-container:
          bus: &bus {MEDOR_BUS__ROUTER: tcp/router:7447}
          door: &door {MEDOR_GATEWAY__HOST: 0.0.0.0, MEDOR_GATEWAY__KEYS: "${MEDOR_GATEWAY__KEYS?who may call}"}
        services:
          gateway:
            command: [python, fake.py]
            profiles: [sim]
            environment: {<<: [*bus, *door], MEDOR_GATEWAY__PLANS_KEPT: 7}
    """
    with Launcher(file=write_cell(tmp_path, containers, told), environment={"MEDOR_X": "y"}, echo=False) as cell:
        eventually(lambda: cell.processes["gateway"].tail)
        environment = eval(cell.processes["gateway"].tail[0])  # printed by the fake above
    assert environment["MEDOR_GATEWAY__HOST"] == "127.0.0.1"
    assert f"http://127.0.0.1:{environment['MEDOR_GATEWAY__PORT']}" == cell.url
    assert environment["MEDOR_BUS__ROUTER"] == cell.router
    assert environment["MEDOR_BUS__ID"] == "gateway"
    assert environment["MEDOR_GATEWAY__PLANS_KEPT"] == "7"
    assert "MEDOR_GATEWAY__KEYS" not in environment
    assert environment["MEDOR_X"] == "y"
