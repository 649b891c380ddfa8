"""Holding the robot: a lease acquired, renewed in the background and given back."""

import threading
import time
from types import TracebackType
from typing import Literal, Self

from medor_wire import endpoints
from medor_wire.bus import Bus, Instance
from medor_wire.errors import LeaseLost, MedorError, Unavailable
from medor_wire.messages import ActOutcome, ActRequest, Lease, LeaseRequest

RENEW_S = 0.5
APPEAR_S = 1.0
"""How long a robot is waited for."""


class Holding:
    """`with Holding(bus) as robot: robot.act(request)`. The lease belongs to `bus.presence`."""

    def __init__(self, bus: Bus, robot: Instance | None = None) -> None:
        """`robot`: which one; the only one there is when absent.

        Raises:
            LeaseHeld: somebody else holds it.
            Unavailable: there is no robot.
        """
        self._bus = bus
        self.robot = robot or _only_robot(bus)
        self._lease = self._ask("acquire")
        self._lost: MedorError | None = None
        self._done = threading.Event()
        self._renewal = threading.Thread(target=self._renew, name="lease", daemon=True)
        self._renewal.start()

    @property
    def epoch(self) -> int:
        return self._lease.epoch

    def check(self) -> None:
        """Raises LeaseLost when the robot is not ours any more."""
        if self._lost is not None:
            raise LeaseLost(f"the lease of {self.robot.presence} was lost: {self._lost}")

    def act(
        self, request: ActRequest, *, cancel: threading.Event | None = None, request_id: str | None = None
    ) -> ActOutcome:
        """Carry `request` out under the current epoch. Raises what `Bus.ask` says and LeaseLost."""
        self.check()
        fenced = request.model_copy(update={"epoch": self.epoch})
        return self._bus.ask(endpoints.ACT, fenced, instance=self.robot, cancel=cancel, request_id=request_id)

    def release(self) -> None:
        """Give the robot back; never raises, the lease would run out by itself."""
        self._done.set()
        self._renewal.join()
        if self._lost is None:
            try:
                self._ask("release")
            except MedorError as error:
                self._lost = error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def _ask(self, action: Literal["acquire", "renew", "release"]) -> Lease:
        epoch = 0 if action == "acquire" else self.epoch
        request = LeaseRequest(holder=self._bus.presence, action=action, epoch=epoch)
        return self._bus.ask(endpoints.LEASE, request, instance=self.robot, timeout_s=1.0)

    def _renew(self) -> None:
        while not self._done.wait(RENEW_S):
            try:
                self._ask("renew")
            except MedorError as error:
                if not isinstance(error, Unavailable):
                    self._lost = error
                    return
                # Unheard renewals cost nothing until the robot itself says that the lease has run out.


def _only_robot(bus: Bus) -> Instance:
    deadline = time.monotonic() + APPEAR_S
    while not (robots := bus.instances("robot")) and time.monotonic() < deadline:
        time.sleep(0.02)
    if len(robots) != 1:
        raise Unavailable(f"expected one robot on the bus, got {len(robots)}")
    return robots[0]
