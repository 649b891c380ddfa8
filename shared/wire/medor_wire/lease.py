"""Who may move the robot: one holder at a time, fenced by an epoch; and the latched emergency stop.

The emergency stop over a network is a convenience, not a safety function.
"""

import threading
import time
from collections.abc import Callable

from medor_wire.bus import Call, Instance
from medor_wire.errors import EmergencyStopped, LeaseHeld, LeaseLost
from medor_wire.ledger import Ledger
from medor_wire.messages import ClearStop, EmergencyStop, Lease, LeaseRequest

TTL_S = 2.0
"""A lease not renewed for this long is lost."""
STOP = "stop"
"""The ledger's fact that the emergency stop is latched, with its reason."""


class Lessor:
    """Grants the robot to one holder at a time. Motion calls `check` at every step and stops when it raises."""

    def __init__(self, ledger: Ledger, *, ttl_s: float = TTL_S, clock: Callable[[], float] = time.monotonic) -> None:
        """`ledger` keeps the epoch and a latched stop across restarts."""
        self._ledger = ledger
        self._ttl_s = ttl_s
        self._clock = clock
        self._lock = threading.RLock()
        self._holder: str | None = None
        self._expires = 0.0
        self._epoch = ledger.next_epoch()
        self._stop = ledger.fact(STOP)

    @property
    def holder(self) -> str | None:
        """Presence of whoever holds the robot now."""
        with self._lock:
            return self._holder if self._holder and self._clock() < self._expires else None

    @property
    def epoch(self) -> int:
        """The current fencing epoch; it changes whenever the robot changes hands."""
        return self._epoch

    @property
    def stopped(self) -> str | None:
        """Why the emergency stop is latched, None when it is not."""
        return self._stop

    def lease(self, request: LeaseRequest, call: Call) -> Lease:
        """Handler of `robot/lease`.

        Raises:
            LeaseHeld: somebody else holds the robot.
            LeaseLost: the lease to renew or to release is not the current one.
        """
        with self._lock:
            if request.action == "acquire":
                return self._acquire(request.holder)
            self._check_current(request.epoch, request.holder)
            if request.action == "release":
                self._revoke()
            else:
                self._expires = self._clock() + self._ttl_s
            return Lease(epoch=self._epoch, ttl_s=self._ttl_s)

    def check(self, epoch: int) -> None:
        """May whoever holds `epoch` move the robot, or go on moving it?

        Raises:
            EmergencyStopped: the emergency stop is latched.
            LeaseLost: the robot has changed hands, or the lease was not renewed in time.
        """
        with self._lock:
            if self._stop is not None:
                raise EmergencyStopped(f"stopped: {self._stop}; an operator has to clear it")
            self._check_current(epoch)

    def gone(self, instance: Instance, alive: bool) -> None:
        """For `Bus.on_presence`: a holder that vanished loses the lease at once."""
        with self._lock:
            if not alive and instance.presence == self._holder:
                self._revoke()

    def stop(self, order: EmergencyStop) -> None:
        """For `Bus.subscribe(STOP)`: latch the emergency stop. Anyone may."""
        with self._lock:
            self._stop = order.reason or f"ordered by {order.source or 'somebody'}"
            self._ledger.record(STOP, self._stop)

    def clear_stop(self, order: ClearStop) -> None:
        """Release the emergency stop; leases never do. What was stopped stays stopped: every lease is revoked."""
        with self._lock:
            self._revoke()
            self._stop = None
            self._ledger.record(STOP, None)

    def _acquire(self, holder: str) -> Lease:
        if (current := self.holder) is not None and current != holder:
            raise LeaseHeld(f"the robot is held by {current}")
        self._epoch = self._ledger.next_epoch()
        self._holder = holder
        self._expires = self._clock() + self._ttl_s
        return Lease(epoch=self._epoch, ttl_s=self._ttl_s)

    def _revoke(self) -> None:
        self._holder = None

    def _check_current(self, epoch: int, holder: str | None = None) -> None:
        current = self.holder
        if epoch != self._epoch or current is None or (holder is not None and holder != current):
            raise LeaseLost(f"epoch {epoch} is not the lease in force ({self._epoch}, held by {current or 'nobody'})")
