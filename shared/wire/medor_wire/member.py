"""One process on a bus, whatever the transport: asks with retries, serves, beats, leaves cleanly."""

import atexit
import contextlib
import random
import secrets
import signal
import threading
import time
import uuid
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, TypeVar

from medor_wire import codec, logs
from medor_wire.asking import Waiter
from medor_wire.bus import Call, Health, Instance, Subscription
from medor_wire.endpoints import Endpoint, Topic
from medor_wire.envelope import Envelope
from medor_wire.errors import BadFrame, Busy, Cancelled, Timeout, Unavailable
from medor_wire.messages import Heartbeat, Message
from medor_wire.metrics import Metrics
from medor_wire.peers import Peers
from medor_wire.server import Server
from medor_wire.transport import Mailbox, Transport

Request = TypeVar("Request", bound=Message)
Reply = TypeVar("Reply", bound=Message)
Content = TypeVar("Content", bound=Message)

ATTEMPTS = 3
"""Of a read: the first and two more."""
PAUSE_S = (0.02, 0.1)
"""Between attempts, drawn at random so that askers turned away together do not come back together."""
GRACE_S = 1.0
"""How long a request waits for somebody who serves it to appear; nothing has been sent yet."""
BEAT_S = 1.0
FORGET_S = 60.0
"""A process not heard of for this long leaves the health table."""
LEAVE_S = 1.0
"""How long handlers get to notice that the process is leaving."""


class Member:
    """Implements `Bus` over a `Transport`."""

    def __init__(self, id: str, transport: Transport, boot: str | None = None) -> None:
        self.id = id
        self.boot = boot or secrets.token_hex(4)
        self.presence = f"{self.id}/{self.boot}"
        self.metrics = Metrics()
        self._transport = transport
        self._peers = Peers()
        self._servers: dict[str, Server] = {}
        self._ready: tuple[bool, str] | None = None
        self._health: dict[str, tuple[Heartbeat, float]] = {}
        self._started = time.monotonic()
        self._announced = False
        self._closed = False
        self._closing = threading.Event()
        self._lock = threading.RLock()
        self._heart: threading.Thread | None = None
        transport.on_presence(self._peers.update)
        transport.on_heartbeat(self._heard)
        # An interpreter that shuts down around an open session aborts or hangs.
        atexit.register(self.close)

    # --- asking ---------------------------------------------------------------------------------------------------

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
        if not isinstance(request, endpoint.request):
            raise TypeError(f"{endpoint.name} takes {endpoint.request.__name__}, got {type(request).__name__}")
        frame = codec.encode(request)
        deadline = time.monotonic() + (endpoint.timeout_s if timeout_s is None else timeout_s)
        request_id = request_id or uuid.uuid4().hex[:16]
        attempts = ATTEMPTS if endpoint.read_only and instance is None else 1
        tried: list[Instance] = []
        while True:
            target = self._target(endpoint, instance, tried, deadline)
            try:
                return self._ask_once(endpoint, target, frame, request_id, deadline, on_progress, cancel)
            except Timeout:
                self._peers.failed(target)
                raise
            except Unavailable as error:
                self._peers.failed(target)
                tried.append(target)
                others = set(self._peers.of(endpoint.service)) - set(tried)
                believed = error.reported and not isinstance(error, Busy) and not others
                if believed or len(tried) == attempts or time.monotonic() >= deadline:
                    raise
            self._closing.wait(min(random.uniform(*PAUSE_S), max(0.0, deadline - time.monotonic())))

    def _target(
        self, endpoint: Endpoint[Any, Any], instance: Instance | None, tried: list[Instance], deadline: float
    ) -> Instance:
        if self._closing.is_set():
            raise Unavailable(f"{self.id} has left the bus")
        if instance is None:
            grace = max(0.0, min(GRACE_S, deadline - time.monotonic()))
            return self._peers.pick(endpoint.service, tried, grace)
        if instance not in self._peers.of(endpoint.service):
            raise Unavailable(f"{instance.presence} does not serve {endpoint.service} any more")
        return instance

    def _ask_once(
        self,
        endpoint: Endpoint[Request, Reply],
        target: Instance,
        frame: bytes,
        request_id: str,
        deadline: float,
        on_progress: Callable[[Message], None] | None,
        cancel: threading.Event | None,
    ) -> Reply:
        if cancel is not None and cancel.is_set():
            raise Cancelled(f"{endpoint.name} was cancelled before it was sent")
        left = deadline - time.monotonic()
        if left <= 0:
            raise Timeout(f"no time left to ask {endpoint.name}")
        envelope = Envelope(uuid.uuid4().hex, request_id, time.time() + left, self.presence)
        mailbox = Mailbox()
        waiter = Waiter(endpoint, mailbox, deadline, lambda: self._transport.cancel(target, envelope.ask), cancel)
        self._transport.ask(target, endpoint.verb, frame, envelope.pack(), left, mailbox)
        return waiter.wait(on_progress)  # type: ignore[return-value]

    # --- serving --------------------------------------------------------------------------------------------------

    def serve(
        self,
        endpoint: Endpoint[Request, Reply],
        handler: Callable[[Request, Call], Reply],
        *,
        workers: int = 1,
        queue: int = 4,
    ) -> None:
        server = Server(endpoint, handler, workers=workers, queue=queue, observe=self._observe, defect=logs.defect)
        instance = self._instance(endpoint.service)
        with self._lock:
            if endpoint.name in self._servers:
                raise ValueError(f"{endpoint.name} is served already")
            if endpoint.service not in self._services():
                self._transport.on_cancel(instance, self._withdraw)
            self._servers[endpoint.name] = server
            self._transport.serve(instance, endpoint.verb, server.offer)
            if self._announced:
                self._transport.announce(instance)
        self._start_heart()

    def announce(self) -> None:
        with self._lock:
            self._announced = True
            if self._ready is None:
                self._ready = (True, "")
            for service in self._services():
                self._transport.announce(self._instance(service))

    def run(self) -> None:
        self.announce()
        logs.logger("bus").info("serving", endpoints=sorted(self._servers))
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, lambda *_: self._closing.set())
        while not self._closing.wait(0.5):  # a slice, so that signals get in
            pass
        self.close()

    # --- broadcasts -----------------------------------------------------------------------------------------------

    def publish(self, topic: Topic[Content], message: Content) -> None:
        if not isinstance(message, topic.content):
            raise TypeError(f"{topic.name} carries {topic.content.__name__}, got {type(message).__name__}")
        self._transport.publish(topic.name, codec.encode(message), urgent=topic.urgent)

    def subscribe(self, topic: Topic[Content], callback: Callable[[Content], None]) -> Subscription:
        def deliver(frame: bytes) -> None:
            try:
                callback(codec.decode(topic.content, frame))
            except Exception:
                logs.defect(topic.name, "")

        return self._transport.subscribe(topic.name, deliver)

    # --- presence and health --------------------------------------------------------------------------------------

    def instances(self, service: str) -> list[Instance]:
        return self._peers.of(service)

    def on_presence(self, callback: Callable[[Instance, bool], None]) -> None:
        self._peers.watch(callback)

    def ready(self, ready: bool = True, detail: str = "") -> None:
        self._ready = (ready, detail)
        self._start_heart()
        self._beat()

    def health(self) -> dict[str, Health]:
        now = time.monotonic()
        with self._lock:
            self._health = {key: (beat, at) for key, (beat, at) in self._health.items() if now - at < FORGET_S}
            return {key: Health(**beat.model_dump(), age_s=now - at) for key, (beat, at) in self._health.items()}

    def _heard(self, frame: bytes) -> None:
        with contextlib.suppress(BadFrame):
            beat = codec.decode(Heartbeat, frame)
            with self._lock:
                self._health[f"{beat.service}/{beat.id}"] = (beat, time.monotonic())

    def _start_heart(self) -> None:
        with self._lock:
            if self._heart is None:
                self._heart = threading.Thread(target=self._keep_beating, name="heart", daemon=True)
                self._heart.start()

    def _keep_beating(self) -> None:
        while not self._closing.is_set():
            self._beat()
            self._closing.wait(BEAT_S)

    def _beat(self) -> None:
        ready, detail = self._ready or (False, "starting")
        busy = sum(server.busy for server in list(self._servers.values()))
        self.metrics.beat(busy, ready)
        uptime_s = time.monotonic() - self._started
        for service in self._services() or {self.id}:
            beat = Heartbeat(
                service=service, id=self.id, boot=self.boot, ready=ready, detail=detail, busy=busy, uptime_s=uptime_s
            )
            self._transport.publish(f"health/{service}/{self.id}", codec.encode(beat))

    # --- leaving --------------------------------------------------------------------------------------------------

    def close(self) -> None:
        with self._lock:
            self._closing.set()
            if self._closed:
                return
            self._closed = True
            servers, self._servers = self._servers, {}
        self._transport.withdraw()
        for server in servers.values():
            server.close(LEAVE_S)
        if self._heart is not None and self._heart is not threading.current_thread():
            self._heart.join(BEAT_S)
        self._transport.close()
        atexit.unregister(self.close)
        self._peers.close()
        self.metrics.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _instance(self, service: str) -> Instance:
        return Instance(service, self.id, self.boot)

    def _services(self) -> set[str]:
        return {server.endpoint.service for server in list(self._servers.values())}

    def _withdraw(self, ask: str) -> None:
        for server in list(self._servers.values()):
            server.withdraw(ask)

    def _observe(self, endpoint: str, request_id: str, seconds: float, outcome: str) -> None:
        self.metrics.request(endpoint, seconds, outcome)
        server = self._servers.get(endpoint)
        routine = server is not None and server.endpoint.routine
        logs.request(endpoint, request_id, seconds, outcome, routine=routine)
