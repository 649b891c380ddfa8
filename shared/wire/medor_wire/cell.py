"""The robot's contract: what every cell can be asked, the simulated and the real one alike."""

import logging
from typing import Protocol

from medor_wire import endpoints
from medor_wire.bus import Bus, Call
from medor_wire.lease import Lessor
from medor_wire.messages import (
    ActOutcome,
    ActRequest,
    CellStatus,
    ClearStop,
    DepthView,
    EmergencyStop,
    Empty,
    Lease,
    LeaseRequest,
    Reach,
    ReachRequest,
)

log = logging.getLogger(__name__)


class Cell(Protocol):
    """A table, a camera and an arm. All methods are handlers; `act` runs while the others answer."""

    def capture(self, request: Empty, call: Call) -> DepthView: ...

    def status(self, request: Empty, call: Call) -> CellStatus: ...

    def reach(self, request: ReachRequest, call: Call) -> Reach: ...

    def act(self, request: ActRequest, call: Call) -> ActOutcome: ...


def serve_cell(bus: Bus, cell: Cell, lessor: Lessor) -> None:
    """Serve `robot/*` with a cell, under leases and the emergency stop; observers hear of every change."""

    def tell() -> None:
        bus.publish(endpoints.CELL, cell.status(Empty(), Call()))

    def lease(request: LeaseRequest, call: Call) -> Lease:
        granted = lessor.lease(request, call)
        if request.action != "renew":
            tell()
        return granted

    def stop(order: EmergencyStop) -> None:
        lessor.stop(order)
        log.warning("emergency stop: %s", lessor.stopped)
        tell()

    def clear_stop(order: ClearStop, call: Call) -> CellStatus:
        lessor.clear_stop(order)
        log.warning("emergency stop cleared by %s", order.operator)
        tell()
        return cell.status(Empty(), call)

    bus.serve(endpoints.CAPTURE, cell.capture)
    bus.serve(endpoints.STATUS, cell.status)
    bus.serve(endpoints.REACH, cell.reach)
    bus.serve(endpoints.ACT, cell.act)
    bus.serve(endpoints.LEASE, lease)
    bus.serve(endpoints.CLEAR_STOP, clear_stop)
    bus.subscribe(endpoints.STOP, stop)
    bus.on_presence(lessor.gone)
