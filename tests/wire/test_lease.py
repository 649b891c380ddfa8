"""One holder at a time, fenced by its epoch; the emergency stop outlives every lease."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from medor_wire.bus import Call, Instance
from medor_wire.errors import EmergencyStopped, LeaseHeld, LeaseLost
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.messages import ClearStop, EmergencyStop, Lease, LeaseRequest


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


class Cell:
    """A lessor on a clock that the test turns."""

    def __init__(self, ledger: Ledger) -> None:
        self.clock = Clock()
        self.lessor = Lessor(ledger, ttl_s=2.0, clock=self.clock)

    def ask(self, holder: str, action: str = "acquire", epoch: int = 0) -> Lease:
        return self.lessor.lease(LeaseRequest(holder=holder, action=action, epoch=epoch), Call())  # type: ignore[arg-type]


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    ledger = Ledger(tmp_path / "ledger.db")
    yield ledger
    ledger.close()


@pytest.fixture
def cell(ledger: Ledger) -> Cell:
    return Cell(ledger)


def test_one_holder_at_a_time(cell: Cell) -> None:
    lease = cell.ask("planner/1")
    with pytest.raises(LeaseHeld, match="planner/1"):
        cell.ask("other/2")
    cell.lessor.check(lease.epoch)
    cell.ask("planner/1", "release", lease.epoch)
    assert cell.ask("other/2").epoch > lease.epoch


def test_an_old_epoch_is_fenced_off(cell: Cell) -> None:
    old = cell.ask("planner/1")
    cell.ask("planner/1", "release", old.epoch)
    new = cell.ask("other/2")
    with pytest.raises(LeaseLost):
        cell.lessor.check(old.epoch)
    cell.lessor.check(new.epoch)


def test_nobody_may_move_without_a_lease(cell: Cell) -> None:
    with pytest.raises(LeaseLost, match="nobody"):
        cell.lessor.check(cell.lessor.epoch)


def test_a_lease_not_renewed_runs_out(cell: Cell) -> None:
    lease = cell.ask("planner/1")
    for _ in range(8):
        cell.clock.now += 0.5
        cell.ask("planner/1", "renew", lease.epoch)
    cell.lessor.check(lease.epoch)
    cell.clock.now += 2.0
    assert cell.lessor.holder is None
    with pytest.raises(LeaseLost):
        cell.lessor.check(lease.epoch)
    with pytest.raises(LeaseLost):
        cell.ask("planner/1", "renew", lease.epoch)


def test_a_vanished_holder_loses_the_lease_at_once(cell: Cell) -> None:
    lease = cell.ask("planner/1")
    cell.lessor.gone(Instance("planner", "planner", "2"), False)
    cell.lessor.gone(Instance("planner", "planner", "1"), True)
    cell.lessor.check(lease.epoch)
    cell.lessor.gone(Instance("planner", "planner", "1"), False)
    with pytest.raises(LeaseLost):
        cell.lessor.check(lease.epoch)


@pytest.mark.parametrize("attempt", ["acquire", "renew", "release"])
def test_leases_never_clear_the_stop(cell: Cell, attempt: str) -> None:
    epoch = cell.ask("planner/1").epoch
    cell.lessor.stop(EmergencyStop(reason="hand in the cell"))
    epoch = cell.ask("planner/1", attempt, epoch).epoch
    with pytest.raises(EmergencyStopped, match="hand in the cell"):
        cell.lessor.check(epoch)


def test_only_an_operator_clears_the_stop_and_nothing_moves_on_by_itself(cell: Cell) -> None:
    lease = cell.ask("planner/1")
    cell.lessor.stop(EmergencyStop(source="gateway"))
    cell.lessor.clear_stop(ClearStop(operator="ada"))
    assert cell.lessor.stopped is None
    with pytest.raises(LeaseLost):
        cell.lessor.check(lease.epoch)
    cell.lessor.check(cell.ask("planner/1").epoch)


def _stop(cell: Cell) -> None:
    cell.lessor.stop(EmergencyStop(reason="smoke"))


@pytest.mark.parametrize(("before", "error"), [(_stop, EmergencyStopped), (lambda cell: None, LeaseLost)])
def test_a_restart_keeps_the_stop_and_fences_the_past(
    ledger: Ledger, cell: Cell, before: Callable[[Cell], None], error: type[Exception]
) -> None:
    lease = cell.ask("planner/1")
    before(cell)
    restarted = Cell(ledger)
    with pytest.raises(error):
        restarted.lessor.check(lease.epoch)
