"""A bus inside one process: for tests and for trying things out. Same codec, admission, deadlines and retries."""

import threading
from collections import defaultdict
from collections.abc import Callable

from medor_wire.bus import Instance
from medor_wire.errors import MedorError, error_from
from medor_wire.member import Member
from medor_wire.transport import Answer, Incoming, Mailbox


class LocalBus(Member):
    """A member of an in-process bus. What it serves can be asked at once, without `announce` or `run`."""

    def __init__(self, id: str = "local", hub: "Hub | None" = None) -> None:
        self._hub = hub or Hub()
        super().__init__(id, LocalTransport(self._hub))
        self.announce()

    def connect(self, id: str) -> "LocalBus":
        """Another member of the same bus."""
        return LocalBus(id, self._hub)


class Hub:
    """What all members of one in-process bus share."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.offers: dict[tuple[Instance, str], Callable[[Incoming], None]] = {}
        self.withdrawals: dict[Instance, Callable[[str], None]] = {}
        self.alive: set[Instance] = set()
        self.pending: dict[Instance, set[Mailbox]] = defaultdict(set)
        self.presence: list[Callable[[Instance, bool], None]] = []
        self.heartbeats: list[Callable[[bytes], None]] = []
        self.watchers: dict[str, set[Ring]] = defaultdict(set)


class Ring:
    """Holds the newest frame only and hands it to a listener in a thread of its own."""

    def __init__(self, hub: Hub, name: str, listener: Callable[[bytes], None]) -> None:
        self._hub = hub
        self._name = name
        self._listener = listener
        self._newest: bytes | None = None
        self._open = True
        self._filled = threading.Condition()
        threading.Thread(target=self._deliver, name=f"watch {name}", daemon=True).start()

    def put(self, frame: bytes) -> None:
        with self._filled:
            self._newest = frame
            self._filled.notify()

    def close(self) -> None:
        with self._hub.lock:
            self._hub.watchers[self._name].discard(self)
        with self._filled:
            self._open = False
            self._filled.notify()

    def _deliver(self) -> None:
        while True:
            with self._filled:
                self._filled.wait_for(lambda: self._newest is not None or not self._open)
                frame, self._newest = self._newest, None
            if not self._open or frame is None:
                return
            self._listener(frame)


class LocalIncoming:
    """A request handed over in memory."""

    def __init__(self, frame: bytes, attachment: bytes, mailbox: Mailbox, ended: Callable[[], None]) -> None:
        self.attachment = attachment
        self.size = len(frame)
        self._frame = frame
        self._mailbox = mailbox
        self._ended = ended

    def frame(self) -> bytes:
        return self._frame

    def progress(self, frame: bytes) -> None:
        self._mailbox.put(Answer("progress", frame))

    def reply(self, frame: bytes) -> None:
        self._mailbox.put(Answer("reply", frame))
        self._ended()

    def fail(self, error: MedorError) -> None:
        self._mailbox.put(Answer("error", error=error_from(error.code, str(error))))
        self._ended()


class LocalTransport:
    """Implements `Transport` by calling the other members' listeners."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._served: set[Instance] = set()
        self._rings: list[Ring] = []
        self._listeners: list[Callable[..., None]] = []

    def serve(self, instance: Instance, verb: str, offer: Callable[[Incoming], None]) -> None:
        with self._hub.lock:
            self._hub.offers[instance, verb] = offer
            self._served.add(instance)

    def on_cancel(self, instance: Instance, withdraw: Callable[[str], None]) -> None:
        self._hub.withdrawals[instance] = withdraw

    def announce(self, instance: Instance) -> None:
        self._presence(instance, True)

    def withdraw(self) -> None:
        for instance in self._served:
            self._presence(instance, False)

    def on_presence(self, listener: Callable[[Instance, bool], None]) -> None:
        with self._hub.lock:
            self._listeners.append(listener)
            self._hub.presence.append(listener)
            for instance in self._hub.alive:
                listener(instance, True)

    def ask(
        self, instance: Instance, verb: str, frame: bytes, attachment: bytes, timeout_s: float, mailbox: Mailbox
    ) -> None:
        with self._hub.lock:
            offer = self._hub.offers.get((instance, verb))
            pending = self._hub.pending[instance]
            pending.add(mailbox)
        if offer is None:
            mailbox.put(Answer("end"))
        else:
            offer(LocalIncoming(frame, attachment, mailbox, lambda: pending.discard(mailbox)))

    def cancel(self, instance: Instance, ask: str) -> None:
        if withdraw := self._hub.withdrawals.get(instance):
            withdraw(ask)

    def publish(self, name: str, frame: bytes, *, urgent: bool = False) -> None:
        with self._hub.lock:
            rings = list(self._hub.watchers[name])
            heartbeats = list(self._hub.heartbeats) if name.startswith("health/") else []
        for ring in rings:
            ring.put(frame)
        for listener in heartbeats:
            listener(frame)

    def subscribe(self, name: str, listener: Callable[[bytes], None]) -> Ring:
        ring = Ring(self._hub, name, listener)
        with self._hub.lock:
            self._hub.watchers[name].add(ring)
            self._rings.append(ring)
        return ring

    def on_heartbeat(self, listener: Callable[[bytes], None]) -> None:
        with self._hub.lock:
            self._listeners.append(listener)
            self._hub.heartbeats.append(listener)

    def close(self) -> None:
        for ring in self._rings:
            ring.close()
        with self._hub.lock:
            self._hub.presence = [x for x in self._hub.presence if x not in self._listeners]
            self._hub.heartbeats = [x for x in self._hub.heartbeats if x not in self._listeners]
            for key in [key for key in self._hub.offers if key[0] in self._served]:
                del self._hub.offers[key]
            abandoned = [mailbox for instance in self._served for mailbox in self._hub.pending.pop(instance, ())]
        for mailbox in abandoned:
            mailbox.put(Answer("end"))

    def _presence(self, instance: Instance, alive: bool) -> None:
        with self._hub.lock:
            (self._hub.alive.add if alive else self._hub.alive.discard)(instance)
            for listener in self._hub.presence:
                listener(instance, alive)
