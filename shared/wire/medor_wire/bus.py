"""The bus as everyone sees it: ask, serve, publish, subscribe. Implementations: `ZenohBus`, `LocalBus`."""

import math
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from medor_wire.config import BusConfig
from medor_wire.endpoints import Endpoint, Topic
from medor_wire.errors import Cancelled, Timeout
from medor_wire.messages import Heartbeat, Message

Request = TypeVar("Request", bound=Message)
Reply = TypeVar("Reply", bound=Message)
Content = TypeVar("Content", bound=Message)


@dataclass(frozen=True, order=True)
class Instance:
    """One process that serves `service`. `boot` differs at every start."""

    service: str
    id: str
    boot: str

    @property
    def presence(self) -> str:
        """What a lease's holder is."""
        return f"{self.id}/{self.boot}"


class Health(Heartbeat):
    """The last heartbeat seen of a process."""

    age_s: float
    """Since it arrived; healthy processes stay below 3 s."""


class Call:
    """What a handler may use beside its request. `Call()` is good for calling a handler directly."""

    def __init__(
        self,
        request_id: str = "direct",
        deadline: float = math.inf,
        progress: Callable[[Message], None] | None = None,
    ) -> None:
        """`deadline` is on `time.monotonic`'s clock."""
        self.request_id = request_id
        self.deadline = deadline
        self._progress = progress
        self._withdrawn = threading.Event()

    def progress(self, message: Message) -> None:
        """Stream `message` to the asker."""
        if self._progress is not None:
            self._progress(message)

    def withdraw(self) -> None:
        """Tell the handler that nobody wants its reply any more."""
        self._withdrawn.set()

    def withdrawn(self) -> bool:
        """Whether the asker cancelled. Motion asks this: a deadline bounds its start only."""
        return self._withdrawn.is_set()

    def cancelled(self) -> bool:
        """Whether the asker cancelled or the deadline has passed."""
        return self._withdrawn.is_set() or time.monotonic() > self.deadline

    def check(self) -> None:
        """Go on or not.

        Raises:
            Cancelled: the asker cancelled.
            Timeout: the deadline has passed.
        """
        if self._withdrawn.is_set():
            raise Cancelled(f"request {self.request_id} was cancelled")
        if time.monotonic() > self.deadline:
            raise Timeout(f"the deadline of request {self.request_id} passed while it ran")


class Subscription(Protocol):
    def close(self) -> None: ...


class Bus(Protocol):
    """One member of the bus. All methods are thread-safe."""

    id: str
    boot: str
    presence: str
    """`id/boot`: names this process in a lease."""

    def ask(
        self,
        endpoint: Endpoint[Request, Reply],
        request: Request,
        *,
        timeout_s: float | None = None,
        instance: Instance | None = None,
        on_progress: Callable[[Message], None] | None = None,
        cancel: threading.Event | None = None,
        request_id: str | None = None,
    ) -> Reply:
        """Ask one live instance and wait for its answer.

        Reads are asked again, up to twice and on other instances, when nobody answered or all were busy. Anything
        with a side effect is sent once. Setting `cancel` tells the server; its last word is then waited for briefly.

        Raises:
            MedorError: what the server reported, as the class it raised.
            Unavailable: nobody serves this, or the server vanished (a side effect may have happened).
            Timeout: no answer by the deadline.
            Cancelled: `cancel` was set and the server stopped, or did not say otherwise within a second.
        """
        ...

    def serve(
        self,
        endpoint: Endpoint[Request, Reply],
        handler: Callable[[Request, Call], Reply],
        *,
        workers: int = 1,
        queue: int = 4,
    ) -> None:
        """Answer with `handler`. More than `workers + queue` requests at once are turned away as `Busy`."""
        ...

    def publish(self, topic: Topic[Content], message: Content) -> None:
        """Tell everyone who watches `topic`; never waits for them."""
        ...

    def subscribe(self, topic: Topic[Content], callback: Callable[[Content], None]) -> Subscription:
        """Watch `topic` in a thread of its own: a slow callback misses messages and always gets the newest."""
        ...

    def instances(self, service: str) -> list[Instance]:
        """Who serves `service` now."""
        ...

    def on_presence(self, callback: Callable[[Instance, bool], None]) -> None:
        """Tell who is there now, then who comes (True) and goes (False). A process may be present and yet stuck."""
        ...

    def ready(self, ready: bool = True, detail: str = "") -> None:
        """What the heartbeat says."""
        ...

    def health(self) -> dict[str, Health]:
        """The last heartbeat of every process, by `service/id`."""
        ...

    def announce(self) -> None:
        """Be found by those who ask."""
        ...

    def run(self) -> None:
        """Announce, then serve until SIGTERM, SIGINT or `close`; leaves cleanly."""
        ...

    def close(self) -> None:
        """Leave: withdraw presence, cancel what runs, close the link."""
        ...


def join(id: str, config: BusConfig | None = None, *, patience_s: float = math.inf) -> AbstractContextManager[Bus]:
    """A member of the Zenoh bus, closed at the end of the `with` block. `config.id` takes precedence over `id`.

    Raises:
        Unavailable: there is no router within `patience_s`.
    """
    from medor_wire.zenoh_bus import ZenohBus  # whoever needs only the interface does not load Zenoh

    return ZenohBus(id, config or BusConfig(), patience_s=patience_s)
