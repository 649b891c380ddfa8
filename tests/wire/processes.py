"""Server processes that the tests start, kill and stop. Always spawned: a forked Zenoh session hangs."""

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from medor_wire import endpoints, examples
from medor_wire.bus import Call
from medor_wire.config import BusConfig
from medor_wire.errors import MedorError
from medor_wire.holding import Holding
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.messages import (
    ActOutcome,
    ActRequest,
    CellStatus,
    DepthView,
    Empty,
    Reach,
    ReachRequest,
)
from medor_wire.zenoh_bus import ZenohBus
from medor_wire.zenoh_config import router_config

SPAWN = multiprocessing.get_context("spawn")
STEP_S = 0.01


@contextmanager
def running(target: Any, *args: Any) -> Iterator[SpawnProcess]:
    """`target(*args)` in a process of its own, killed at the end if it is still there."""
    process = SPAWN.Process(target=target, args=args, daemon=True)
    process.start()
    try:
        yield process
    finally:
        if process.is_alive():
            os.kill(process.pid or 0, signal.SIGCONT)
            process.kill()
        process.join(5)


def router(address: str) -> None:
    with zenoh.open(router_config(address)):
        time.sleep(600)


def robot(config: BusConfig, ledger: Path, log: Path) -> None:
    """A robot whose every motion takes 3 s; what it does is written to `log`."""
    book = Ledger(ledger)
    lessor = Lessor(book)

    def note(line: str) -> None:
        with log.open("a") as file:
            file.write(f"{time.monotonic():.3f} {line}\n")

    def move(request: ActRequest, call: Call) -> ActOutcome:
        note(f"move {request.action_id}")
        for _ in range(300):
            try:
                lessor.check(request.epoch)
            except MedorError as error:
                note(f"stop {request.action_id} {error.code}")
                raise
            time.sleep(STEP_S)
        return ActOutcome(action_id=request.action_id, grasped=True)

    def act(request: ActRequest, call: Call) -> ActOutcome:
        lessor.check(request.epoch)
        return book.once(request, lambda: move(request, call))

    with ZenohBus("robot", config) as bus:
        bus.on_presence(lessor.gone)
        bus.subscribe(endpoints.STOP, lessor.stop)
        bus.serve(endpoints.LEASE, lessor.lease)
        bus.serve(endpoints.ACT, act)
        bus.run()


def holder(config: BusConfig) -> None:
    """A planner that takes the robot and begins a motion."""
    with ZenohBus("planner", config) as bus:
        bus.serve(endpoints.PLAN, lambda request, call: examples.plan())
        bus.announce()
        with Holding(bus) as held:
            held.act(ActRequest(action_id="held", epoch=0, pick=np.zeros(3), place=np.ones(3)))


def status(config: BusConfig) -> None:
    """Answers `robot/status`; hangs on `robot/capture`; `robot/reach` holds the interpreter for x seconds."""

    def reply(request: Empty, call: Call) -> CellStatus:
        return examples.STATUS

    def hang(request: Empty, call: Call) -> DepthView:
        time.sleep(600)
        raise AssertionError

    def stall(request: ReachRequest, call: Call) -> Reach:
        sys.setswitchinterval(600)  # from here on nothing else runs in this interpreter
        until = time.monotonic() + request.points[0, 0]
        while time.monotonic() < until:
            pass
        sys.setswitchinterval(0.005)
        return Reach(reachable=np.array([True]))

    with ZenohBus("status", config) as bus:
        bus.serve(endpoints.STATUS, reply)
        bus.serve(endpoints.CAPTURE, hang)
        bus.serve(endpoints.REACH, stall)
        bus.run()
