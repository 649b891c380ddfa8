"""The router as its container runs it: services meet on it, its health check passes, and it leaves when asked."""

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from medor_wire.bus import join
from medor_wire.config import BusConfig
from medor_wire.launcher import free_port
from medor_wire.router import routing

from .conftest import eventually


@pytest.fixture(scope="module")
def environment() -> dict[str, str]:
    port = free_port()
    return {
        **os.environ,
        "MEDOR_ROUTER__LISTEN": f"tcp/127.0.0.1:{port}",
        "MEDOR_BUS__ROUTER": f"tcp/127.0.0.1:{port}",
        "MEDOR_BUS__METRICS_PORT": str(free_port()),
    }


@pytest.fixture(scope="module")
def router(environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    with subprocess.Popen([sys.executable, "-m", "medor_wire.router"], env=environment) as process:
        yield process
        process.terminate()
        assert process.wait(5) == 0


def healthy(environment: dict[str, str]) -> bool:
    command = [sys.executable, "-m", "medor_wire.health"]
    return subprocess.run(command, env=environment, capture_output=True).returncode == 0


def test_its_health_check_passes(router: subprocess.Popen[bytes], environment: dict[str, str]) -> None:
    eventually(lambda: healthy(environment), seconds=15)
    assert router.poll() is None
    assert not healthy({**environment, "MEDOR_BUS__METRICS_PORT": str(free_port())}), "nobody is there"


def test_members_see_each_other_through_it(router: subprocess.Popen[bytes], environment: dict[str, str]) -> None:
    config = BusConfig(router=environment["MEDOR_BUS__ROUTER"])
    with join("one", config) as one, join("two", config) as two:
        one.ready(True, "hello")
        eventually(lambda: "one/one" in two.health())
        assert two.health()["one/one"].detail == "hello"
    assert router.poll() is None


def test_a_hosted_router_frees_its_port_again() -> None:
    listen = f"tcp/127.0.0.1:{free_port()}"
    for _ in range(2):
        with routing(listen), join("one", BusConfig(router=listen)) as one:
            one.ready()
            eventually(lambda bus=one: "one/one" in bus.health())
