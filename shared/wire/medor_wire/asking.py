"""Waiting for the answer to one request: progress, the first final reply, the deadline, cancellation."""

import threading
import time
from collections.abc import Callable
from queue import Empty
from typing import Any

from medor_wire import codec
from medor_wire.endpoints import Endpoint
from medor_wire.errors import Cancelled, InternalError, Timeout, Unavailable
from medor_wire.messages import Message
from medor_wire.transport import Answer, Mailbox

POLL_S = 0.02
"""How often a cancel event is looked at."""
LAST_WORD_S = 1.0
"""How long a cancelled request waits to learn what the server made of it."""


class Waiter:
    """Waits for one request's end."""

    def __init__(
        self,
        endpoint: Endpoint[Any, Any],
        mailbox: Mailbox,
        deadline: float,
        withdraw: Callable[[], None],
        cancel: threading.Event | None = None,
    ) -> None:
        """`withdraw` tells the server that the asker gave up."""
        self._endpoint = endpoint
        self._mailbox = mailbox
        self._deadline = deadline
        self._withdraw = withdraw
        self._cancel = cancel
        self._cancelled = False

    def wait(self, on_progress: Callable[[Message], None] | None) -> Message:
        """The reply. Raises what `Bus.ask` says."""
        try:
            while (answer := self._next()).kind == "progress":
                if on_progress is not None and self._endpoint.progress is not None:
                    on_progress(codec.decode(self._endpoint.progress, answer.frame))
        except (Timeout, Cancelled):
            raise
        except BaseException:
            self._withdraw()
            raise
        if answer.kind == "reply":
            return codec.decode(self._endpoint.reply, answer.frame)
        if answer.kind == "error":
            raise answer.error or InternalError(f"{self._endpoint.name} failed without saying why")
        if time.monotonic() >= self._deadline:  # the transport's clock rang first
            raise self._too_late()
        raise Unavailable(f"{self._endpoint.name} gave no answer: the server vanished or may not be asked")

    def _next(self) -> Answer:
        while True:
            if self._cancel is not None and self._cancel.is_set() and not self._cancelled:
                self._give_up()
            left = self._deadline - time.monotonic()
            slice_s = left if self._cancel is None or self._cancelled else min(left, POLL_S)
            try:
                return self._mailbox.get(timeout=max(slice_s, 0.0))
            except Empty:
                if time.monotonic() >= self._deadline:
                    raise self._too_late() from None

    def _give_up(self) -> None:
        self._withdraw()
        self._cancelled = True
        self._deadline = min(self._deadline, time.monotonic() + LAST_WORD_S)

    def _too_late(self) -> Cancelled | Timeout:
        if self._cancelled:
            return Cancelled(f"{self._endpoint.name} was cancelled; the server has not said what it did")
        return Timeout(f"{self._endpoint.name} did not answer by the deadline")
