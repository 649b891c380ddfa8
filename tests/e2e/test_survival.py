"""`kill -9` of anything: the door says so, nobody hangs, and the cell is whole again without help."""

import os
import signal
import threading
import time
from collections.abc import Callable

import httpx
import numpy as np
import pytest

from medor_wire import endpoints
from medor_wire.launcher import Launcher
from medor_wire.messages import Message, PlanProgress, PlanRequest
from medor_wire.supervisor import Process

GARMENT = {"category": "skirt", "garment_seed": 800001, "state": "flat", "seed": 1}
PLAN = {"category": "skirt", "options": {"candidates": 2}}
DOWN_S = 5.0
"""Long enough to look at a cell without the service."""


def until(condition: Callable[[], bool], seconds: float) -> float:
    """Seconds until `condition` holds."""
    start = time.monotonic()
    while not condition():
        assert time.monotonic() - start < seconds, f"not within {seconds} s"
        time.sleep(0.05)
    return time.monotonic() - start


def kill(process: Process, down_s: float = DOWN_S) -> None:
    """`kill -9`; the supervisor will start it again, but not before `down_s`."""
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    until(lambda: process.child is None, 1)
    process.due = time.monotonic() + down_s


def ready(door: httpx.Client) -> bool:
    try:
        return door.get("/readyz").status_code == 200
    except httpx.TransportError:
        return False


@pytest.fixture(scope="module", autouse=True)
def garment(door: httpx.Client) -> None:
    door.post("/cell/reset", json=GARMENT).raise_for_status()


# The simulated cell last: its garment is lost with it.
@pytest.mark.parametrize(
    ("service", "method"), [("recon", "visible"), ("dynamics", "oracle"), ("planner", "oracle"), ("sim", "oracle")]
)
def test_a_lost_service_is_reported_and_comes_back(
    cell: Launcher, door: httpx.Client, service: str, method: str
) -> None:
    for name, process in cell.processes.items():
        if name.startswith(service):
            kill(process)
    until(lambda: not ready(door), 3)

    start = time.monotonic()
    answer = door.post("/plan", json={**PLAN, "method": method})
    assert time.monotonic() - start < DOWN_S
    assert answer.status_code == 503
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["code"] == "unavailable"

    until(lambda: ready(door) and not cell.waiting_for(), 30)


def test_a_lost_door_opens_again(cell: Launcher, door: httpx.Client) -> None:
    kill(cell.processes["gateway"], down_s=0.5)
    assert not ready(door)
    until(lambda: ready(door), 30)


def test_losing_a_replica_in_the_middle_of_a_plan_changes_nothing(cell: Launcher, door: httpx.Client) -> None:
    door.post("/cell/reset", json=GARMENT).raise_for_status()
    request = PlanRequest(category="skirt", method="visible", candidates=200, seed=5)
    whole = cell.bus.ask(endpoints.PLAN, request)
    rolling = threading.Event()

    def watch(progress: Message) -> None:
        if isinstance(progress, PlanProgress) and progress.stage == "rollout" and progress.fraction > 0:
            rolling.set()

    def kill_when_rolling() -> None:
        assert rolling.wait(60)
        kill(cell.processes["dynamics-1"])

    killer = threading.Thread(target=kill_when_rolling)
    killer.start()
    maimed = cell.bus.ask(endpoints.PLAN, request, on_progress=watch)
    killer.join()
    assert cell.processes["dynamics-1"].exit_codes[-1] == -signal.SIGKILL
    np.testing.assert_array_equal(maimed.pick, whole.pick)
    np.testing.assert_array_equal(maimed.place, whole.place)
    np.testing.assert_array_equal(maimed.top_rewards, whole.top_rewards)
    until(lambda: not cell.waiting_for(), 30)
