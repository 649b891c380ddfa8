"""What every cell must do, simulated or real."""

import threading
import time

import numpy as np
import pytest

from medor_wire import endpoints
from medor_wire.errors import EmergencyStopped, IdReused, LeaseHeld, LeaseLost, OutOfReach
from medor_wire.holding import Holding
from medor_wire.messages import (
    ActOutcome,
    CellStatus,
    ClearStop,
    EmergencyStop,
    Empty,
    LeaseRequest,
    ReachRequest,
)


def status(exam) -> CellStatus:
    return exam.ask.ask(endpoints.STATUS, Empty())


def raise_stop(exam) -> None:
    exam.ask.publish(endpoints.STOP, EmergencyStop(reason="test", source="exam"))
    until(lambda: status(exam).state == "stopped")


def until(condition, seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.005)


def test_capture_shows_cloth_from_above(exam):
    before = time.time_ns()
    view = exam.ask.ask(endpoints.CAPTURE, Empty())
    seen = view.depth[view.depth > 0]
    assert before <= view.stamp_ns <= time.time_ns()
    assert 0.5 < seen.min() <= seen.max() < 0.65
    assert np.array_equal(view.mask, view.depth > 0)
    assert view.camera.T_world_camera[2, 3] == pytest.approx(0.65)


def test_reach_agrees_with_what_act_refuses(exam):
    inside, outside = [0.05, 0.05, 0.1], [1.5, 0.0, 0.1]
    points = np.array([inside, outside, inside], np.float32)
    places = np.array([inside, inside, outside], np.float32)
    answer = exam.ask.ask(endpoints.REACH, ReachRequest(points=points, executor=exam.executor))
    assert answer.reachable.tolist() == [True, False, True]
    answer = exam.ask.ask(endpoints.REACH, ReachRequest(points=points, places=places, executor=exam.executor))
    assert answer.reachable.tolist() == [True, False, False]
    epoch = exam.acquire()
    assert exam.act("near", epoch, place=inside).action_id == "near"
    with pytest.raises(OutOfReach, match="place"):
        exam.act("far", epoch, place=outside)
    assert status(exam).actions == 1


def test_a_refused_action_may_be_asked_again(exam):
    with pytest.raises(LeaseLost):
        exam.act("later", epoch=0)
    assert not exam.act("later", exam.acquire()).replayed


def test_nobody_acts_without_the_current_lease(exam):
    old = exam.acquire()
    exam.ask.ask(endpoints.LEASE, LeaseRequest(holder=exam.ask.presence, action="release", epoch=old))
    with pytest.raises(LeaseLost):
        exam.act("released", old)
    new = exam.acquire()
    assert new > old
    with pytest.raises(LeaseLost):
        exam.act("old", old)
    assert status(exam).actions == 0


def test_one_holder_at_a_time(exam):
    exam.acquire("first/1")
    assert status(exam).holder == "first/1"
    with pytest.raises(LeaseHeld, match="first/1"):
        exam.acquire("second/2")


def test_a_holder_that_vanishes_loses_the_lease(exam):
    holder = exam.server.connect("short-lived")
    holder.serve(endpoints.PLAN, lambda request, call: pytest.fail("not asked"))
    epoch = exam.acquire(holder.presence)
    holder.close()
    until(lambda: status(exam).holder is None)
    with pytest.raises(LeaseLost):
        exam.act("orphan", epoch)


def test_the_same_action_again_gets_the_recorded_outcome(exam):
    first = exam.act("once", exam.acquire())
    with Holding(exam.ask) as robot:
        again = exam.act("once", robot.epoch)
    assert not first.replayed
    assert again.replayed
    assert again.model_copy(update={"replayed": False}) == first
    assert status(exam).actions == 1


def test_an_action_id_means_one_action(exam):
    epoch = exam.acquire()
    exam.act("id", epoch)
    with pytest.raises(IdReused):
        exam.act("id", epoch, place=(-0.05, 0.0, 0.1))


def test_ten_copies_at_once_move_once(exam):
    epoch = exam.acquire()
    outcomes: list[object] = []

    def ask() -> None:
        try:
            outcomes.append(exam.act("copies", epoch))
        except Exception as error:
            outcomes.append(error)

    copies = [threading.Thread(target=ask) for _ in range(10)]
    for copy in copies:
        copy.start()
    for copy in copies:
        copy.join()
    done = [o for o in outcomes if isinstance(o, ActOutcome)]
    assert sum(not o.replayed for o in done) == 1
    assert status(exam).actions == 1
    assert {type(o).__name__ for o in outcomes} <= {"ActOutcome", "Busy"}


def test_the_emergency_stop_is_latched(exam):
    epoch = exam.acquire()
    raise_stop(exam)
    assert "test" in status(exam).detail
    with pytest.raises(EmergencyStopped, match="test"):
        exam.act("stopped", epoch)
    with pytest.raises(EmergencyStopped):
        exam.act("leased again", exam.acquire())
    cleared = exam.ask.ask(endpoints.CLEAR_STOP, ClearStop(operator="exam"))
    assert cleared.state == "idle"
    with pytest.raises(LeaseLost):
        exam.act("still the old lease", epoch)
    assert exam.act("cleared", exam.acquire()).action_id == "cleared"


def test_observers_hear_of_leases_actions_and_stops(exam):
    heard: dict[str, list] = {"cell": [], "action": []}
    exam.ask.subscribe(endpoints.CELL, heard["cell"].append)
    exam.ask.subscribe(endpoints.ACTION, heard["action"].append)
    exam.act("watched", exam.acquire())
    until(lambda: [o.action_id for o in heard["action"]] == ["watched"])
    until(lambda: any(s.actions == 1 for s in heard["cell"]))
    raise_stop(exam)
    until(lambda: heard["cell"][-1].state == "stopped")
