"""Holding the robot: renewed for as long as it is held, given back at the end, and noticed when lost."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from medor_wire import endpoints, holding
from medor_wire.bus import Call
from medor_wire.errors import LeaseHeld, LeaseLost, Unavailable
from medor_wire.holding import Holding
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.local_bus import LocalBus
from medor_wire.messages import ActOutcome, ActRequest, ClearStop
from tests.wire.test_bus import eventually

ACTION = ActRequest(action_id="a", epoch=0, pick=np.zeros(3), place=np.ones(3))


class Robot:
    """Moves whenever the lease is in force."""

    def __init__(self, bus: LocalBus, ledger: Ledger) -> None:
        self.lessor = Lessor(ledger, ttl_s=0.3)
        bus.on_presence(self.lessor.gone)
        bus.serve(endpoints.LEASE, self.lessor.lease)
        bus.serve(endpoints.ACT, self.act)

    def act(self, request: ActRequest, call: Call) -> ActOutcome:
        self.lessor.check(request.epoch)
        return ActOutcome(action_id=request.action_id, grasped=True)


@pytest.fixture
def bus() -> Iterator[LocalBus]:
    with LocalBus("planner") as bus:
        yield bus


@pytest.fixture
def robot(bus: LocalBus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    monkeypatch.setattr(holding, "RENEW_S", 0.05)
    ledger = Ledger(tmp_path / "ledger.db")
    with bus.connect("robot") as member:
        yield Robot(member, ledger)
    ledger.close()


def test_a_held_robot_stays_held_past_the_lease(bus: LocalBus, robot: Robot) -> None:
    with Holding(bus) as held:
        time.sleep(0.6)
        assert robot.lessor.holder == bus.presence
        assert held.act(ACTION).grasped
    assert robot.lessor.holder is None


def test_one_planner_holds_the_robot(bus: LocalBus, robot: Robot) -> None:
    with bus.connect("other") as other:
        with Holding(bus), pytest.raises(LeaseHeld, match=bus.presence):
            Holding(other)
        with Holding(other) as held:
            assert held.act(ACTION).grasped


def test_a_lost_lease_is_noticed(bus: LocalBus, robot: Robot) -> None:
    with Holding(bus) as held:
        robot.lessor.clear_stop(ClearStop(operator="ada"))

        def lost() -> bool:
            try:
                held.check()
            except LeaseLost:
                return True
            return False

        eventually(lost)
        with pytest.raises(LeaseLost):
            held.act(ACTION)


def test_there_has_to_be_a_robot(bus: LocalBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(holding, "APPEAR_S", 0.1)
    with pytest.raises(Unavailable, match="got 0"):
        Holding(bus)
