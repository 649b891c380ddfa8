"""What stands between a request and motion, alike for the simulated and the real cell."""

import threading
from collections.abc import Callable
from typing import Literal

from medor_wire.bus import Call
from medor_wire.errors import Cancelled
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.messages import ActOutcome, ActRequest, CameraInfo, Category, CellStatus

Check = Callable[[], None]
"""Raises when the motion must not go on: emergency stop, lease lost, cancelled."""
Move = Callable[[ActRequest, Check], ActOutcome]


class Motion:
    """Lets one thing move at a time, by the holder of the lease, each action at most once."""

    def __init__(self, ledger: Ledger, lessor: Lessor) -> None:
        self.lessor = lessor
        self.actions = 0
        """Carried out since the start."""
        self._ledger = ledger
        self._turn = threading.Lock()
        self._moving = False

    @property
    def state(self) -> Literal["idle", "moving", "stopped"]:
        if self.lessor.stopped is not None:
            return "stopped"
        return "moving" if self._moving else "idle"

    def status(
        self,
        cell: Literal["sim", "robot"],
        category: Category | None = None,
        camera: CameraInfo | None = None,
        detail: str = "",
    ) -> CellStatus:
        """State of the cell; a latched stop's reason comes before `detail`."""
        return CellStatus(
            cell=cell,
            state=self.state,
            category=category,
            holder=self.lessor.holder,
            epoch=self.lessor.epoch,
            actions=self.actions,
            camera=camera,
            detail="; ".join(filter(None, (self.lessor.stopped, detail))),
        )

    def alone(self) -> threading.Lock:
        """Hold this to change what lies on the table without an action in between."""
        return self._turn

    def act(self, request: ActRequest, call: Call, allow: Callable[[ActRequest], None], move: Move) -> ActOutcome:
        """Carry `request` out with `move`, or say what came of it before.

        Refusals before anything moved are not recorded: the same action may be asked again.

        Args:
            request: the action.
            call: whose withdrawal stops the motion.
            allow: raises when the action is impossible here, such as `OutOfReach`.
            move: does it; calls its second argument again and again and stops safely when that raises.

        Raises:
            EmergencyStopped, LeaseLost: before or during the motion.
            Cancelled: the asker withdrew.
            MedorError: what `allow`, `move` or the ledger say.
        """
        with self._turn:
            self.lessor.check(request.epoch)
            call.check()
            allow(request)
            return self._ledger.once(request, lambda: self._move(request, call, move))

    def _move(self, request: ActRequest, call: Call, move: Move) -> ActOutcome:
        def check() -> None:
            self.lessor.check(request.epoch)
            if call.withdrawn():
                raise Cancelled(f"action {request.action_id} was cancelled while it moved")

        self._moving = True
        try:
            outcome = move(request, check)
            self.actions += 1
            return outcome
        finally:
            self._moving = False
