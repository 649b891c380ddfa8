"""The real process on the real bus."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

import httpx
import pytest

from medor_wire import endpoints
from medor_wire import messages as m
from medor_wire.bus import Call, join
from medor_wire.config import BusConfig
from medor_wire.launcher import LOOPBACK, free_port
from medor_wire.router import routing


@dataclass(frozen=True)
class Running:
    process: subprocess.Popen[bytes]
    router: str
    door: httpx.Client


@pytest.fixture
def gateway() -> Iterator[Running]:
    router, port = f"tcp/{LOOPBACK}:{free_port()}", free_port()
    environment = os.environ | {"MEDOR_BUS__ROUTER": router, "MEDOR_GATEWAY__PORT": str(port)}
    command = [sys.executable, "-m", "medor_gateway.serve"]
    with routing(router), subprocess.Popen(command, env=environment) as process:
        try:
            with httpx.Client(base_url=f"http://{LOOPBACK}:{port}", timeout=10) as door:
                wait_for(process, door)
                yield Running(process, router, door)
        finally:
            process.kill()


def wait_for(process: subprocess.Popen[bytes], door: httpx.Client) -> None:
    for _ in range(600):
        with contextlib.suppress(httpx.TransportError):
            assert door.get("/healthz").status_code == 200
            return
        assert process.poll() is None, "the process ended"
        time.sleep(0.05)
    raise AssertionError("the door does not open")


def test_alone_it_says_who_is_missing_and_refuses_at_once(gateway: Running) -> None:
    services = gateway.door.get("/readyz").json()["services"]
    assert set(services) == {"recon", "dynamics", "planner", "robot"}
    assert not any(service["ready"] for service in services.values())
    started = time.monotonic()
    assert gateway.door.post("/plan", json={"category": "skirt"}).json()["code"] == "unavailable"
    assert time.monotonic() - started < 3
    gateway.process.send_signal(signal.SIGTERM)
    assert gateway.process.wait(5) == 0


def test_told_to_end_it_cancels_its_episode_and_leaves_though_that_is_followed(gateway: Running) -> None:
    cancelled = threading.Event()

    def endless(request: m.EpisodeRequest, call: Call) -> m.Episode:
        call.progress(m.EpisodeProgress(step=m.EpisodePick(index=0, coverage_m2=0.1, ni=0.0)))
        while not call.cancelled():
            time.sleep(0.01)
        cancelled.set()
        call.check()
        raise AssertionError

    with join("planner", BusConfig(router=gateway.router)) as planner:
        planner.serve(endpoints.EPISODE, endless)
        planner.announce()
        path = gateway.door.post("/episodes", json={"state": "drop"}).headers["Location"]
        with gateway.door.stream("GET", f"{path}/events") as answer:
            lines = answer.iter_lines()
            assert next(lines) == "id: 1"
            gateway.process.send_signal(signal.SIGTERM)
            assert gateway.process.wait(5) == 0
        assert cancelled.wait(2)
