"""The only seam to a network: how one member's requests, replies and broadcasts get to the others, as bytes."""

from collections.abc import Callable
from queue import SimpleQueue
from typing import Literal, NamedTuple, Protocol

from medor_wire.bus import Instance, Subscription
from medor_wire.errors import MedorError


class Answer(NamedTuple):
    """One thing that came back for a request; `end` says that nothing more will."""

    kind: Literal["progress", "reply", "error", "end"]
    frame: bytes = b""
    error: MedorError | None = None


Mailbox = SimpleQueue[Answer]


class Incoming(Protocol):
    """A request at the server. Exactly one of `reply` and `fail` ends it."""

    attachment: bytes
    size: int

    def frame(self) -> bytes: ...
    def progress(self, frame: bytes) -> None: ...
    def reply(self, frame: bytes) -> None: ...
    def fail(self, error: MedorError) -> None: ...


class Transport(Protocol):
    """None of these may block on a peer; `offer` and the listeners are called on a network thread."""

    def serve(self, instance: Instance, verb: str, offer: Callable[[Incoming], None]) -> None: ...

    def on_cancel(self, instance: Instance, withdraw: Callable[[str], None]) -> None: ...

    def announce(self, instance: Instance) -> None: ...

    def withdraw(self) -> None:
        """Take all presence back."""
        ...

    def on_presence(self, listener: Callable[[Instance, bool], None]) -> None: ...

    def ask(
        self, instance: Instance, verb: str, frame: bytes, attachment: bytes, timeout_s: float, mailbox: Mailbox
    ) -> None: ...

    def cancel(self, instance: Instance, ask: str) -> None: ...

    def publish(self, name: str, frame: bytes, *, urgent: bool = False) -> None: ...

    def subscribe(self, name: str, listener: Callable[[bytes], None]) -> Subscription:
        """Newest frame only, in a thread of its own."""
        ...

    def on_heartbeat(self, listener: Callable[[bytes], None]) -> None: ...

    def close(self) -> None: ...
