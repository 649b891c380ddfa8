"""Health checks tell well from starting, stuck and gone."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from urllib.request import urlopen

import pytest

from medor_wire import endpoints, examples, health
from medor_wire.config import BusConfig
from medor_wire.errors import NoGarment
from medor_wire.member import Member
from medor_wire.messages import Empty
from medor_wire.metrics import Metrics
from tests.wire.conftest import free_port
from tests.wire.test_bus import eventually

Join = Callable[[str], Member]


def figures(metrics: Metrics) -> dict[str, float]:
    return {
        sample.name + str(sorted(sample.labels.values())): sample.value
        for family in metrics.registry.collect()
        for sample in family.samples
    }


def test_a_metrics_page_tells_how_a_process_is() -> None:
    metrics = Metrics()
    port = metrics.serve(0)
    assert "heartbeat" in (health.fault_by_metrics(port) or "")
    metrics.beat(busy=0, ready=False)
    assert health.fault_by_metrics(port) == "not ready"
    metrics.beat(busy=2, ready=True)
    assert health.fault_by_metrics(port) is None
    metrics.close()
    assert "no metrics page" in (health.fault_by_metrics(port) or "")


def test_a_heart_that_stopped_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    metrics = Metrics()
    metrics.beat(busy=0, ready=True)
    port = metrics.serve(0)
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 60)
    assert health.fault_by_metrics(port) == "last heartbeat 60 s ago"
    metrics.close()


def test_requests_are_counted_by_endpoint_and_outcome(join: Join) -> None:
    def fails(request: Empty, call: object) -> object:
        raise NoGarment("an empty table")

    server, asker = join("server"), join("asker")
    server.serve(endpoints.STATUS, lambda request, call: examples.STATUS)
    server.serve(endpoints.TRUTH, fails)  # type: ignore[arg-type]
    server.announce()
    for _ in range(3):
        asker.ask(endpoints.STATUS, Empty())
    with pytest.raises(NoGarment):
        asker.ask(endpoints.TRUTH, Empty())
    eventually(lambda: figures(server.metrics).get("medor_requests_total['no_garment', 'sim/truth']") == 1)
    assert figures(server.metrics)["medor_requests_total['ok', 'robot/status']"] == 3
    assert figures(server.metrics)["medor_request_seconds_count['robot/status']"] == 3
    assert figures(server.metrics)["medor_request_seconds_sum['robot/status']"] < 1


def test_every_request_is_one_line_in_the_log(join: Join, capsys: pytest.CaptureFixture[str]) -> None:
    server = join("server")
    server.serve(endpoints.STATUS, lambda request, call: examples.STATUS)
    server.announce()
    join("asker").ask(endpoints.STATUS, Empty(), request_id="r-23")
    lines: list[str] = []

    def logged() -> bool:
        lines.extend(line for text in capsys.readouterr() for line in text.splitlines() if "r-23" in line)
        return bool(lines)

    eventually(logged)
    assert len(lines) == 1
    assert "robot/status" in lines[0]
    assert "ok" in lines[0]


def test_the_bus_tells_how_a_process_is(zenoh_join: Join, cell_config: BusConfig) -> None:
    other, server = zenoh_join("other"), zenoh_join("server")
    other.ready()
    asked = cell_config.model_copy(update={"id": "server"})
    server.ready(False, "compiling")
    assert health.fault_by_bus(asked) == "not ready compiling"
    server.ready()
    assert health.fault_by_bus(asked) is None
    server.close()


def test_nobody_is_not_well(cell_config: BusConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(health, "LISTEN_S", 0.2)
    assert "no heartbeat of server" in (health.fault_by_bus(cell_config.model_copy(update={"id": "server"})) or "")
    nowhere = BusConfig(router=f"tcp/127.0.0.1:{free_port()}")
    assert "no router" in (health.fault_by_bus(nowhere) or "")


def test_the_command_exits_0_or_1(zenoh_join: Join, cell_config: BusConfig) -> None:
    server = zenoh_join("server")
    server.serve(endpoints.STATUS, lambda request, call: examples.STATUS)
    port = server.metrics.serve(0)
    environment = os.environ | {"MEDOR_BUS__METRICS_PORT": str(port)}

    def check() -> int:
        command = [sys.executable, "-m", "medor_wire.health"]
        return subprocess.run(command, env=environment, timeout=20, capture_output=True, check=False).returncode

    assert check() == 1, "not announced yet"
    server.announce()
    eventually(lambda: b"medor_ready 1.0" in urlopen(f"http://127.0.0.1:{port}/metrics").read())
    assert check() == 0
