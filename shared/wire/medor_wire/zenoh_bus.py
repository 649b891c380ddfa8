"""The bus over Zenoh.

Keys: `medor/<cell>/<service>/<id>/<boot>/<verb>` (one concrete instance each, so that nothing runs twice),
`medor/<cell>/alive/<service>/<id>/<boot>` (presence), `medor/<cell>/<topic>`, `medor/<cell>/health/<service>/<id>`.
"""

import contextlib
import math
import threading
import time
from collections.abc import Callable

import msgpack
import zenoh
from zenoh.handlers import Callback, Handler, RingChannel

from medor_wire import logs
from medor_wire.bus import Instance, join
from medor_wire.config import BusConfig
from medor_wire.errors import MedorError, Timeout, Unavailable, error_from
from medor_wire.member import Member
from medor_wire.transport import Answer, Incoming, Mailbox
from medor_wire.zenoh_config import client_config

__all__ = ["ZenohBus", "ZenohTransport", "join"]

FRAME = zenoh.Encoding("application/vnd.medor.frame")
ERROR = zenoh.Encoding("application/vnd.medor.error")
PROGRESS = b"progress"
JOIN_S = 1.0
LATE_S = 1.0
"""A query is kept so much longer than its asker waits: who runs out of time was not left without an answer."""
CLOSE_S = 3.0
"""Closing a session is known to hang at times; a process leaves all the same."""


class ZenohBus(Member):
    """A member of the bus, client of the router of its configuration."""

    def __init__(self, id: str, config: BusConfig, *, patience_s: float = math.inf) -> None:
        """Connects, waiting `patience_s` for the router.

        Raises:
            Unavailable: there is no router.
        """
        logs.configure(config.log, process=config.id or id)
        super().__init__(config.id or id, ZenohTransport(config, patience_s))
        if config.metrics_port:
            self.metrics.serve(config.metrics_port)


class ZenohIncoming:
    """A query. Dropping it tells the asker that nothing more will come."""

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self.attachment = query.attachment.to_bytes() if query.attachment is not None else b""
        self.size = len(query.payload) if query.payload is not None else 0
        self._query = query
        self._key = key

    def frame(self) -> bytes:
        return self._query.payload.to_bytes() if self._query.payload is not None else b""

    def progress(self, frame: bytes) -> None:
        self._query.reply(self._key, frame, encoding=FRAME, attachment=PROGRESS)

    def reply(self, frame: bytes) -> None:
        with self._query:
            self._query.reply(self._key, frame, encoding=FRAME)

    def fail(self, error: MedorError) -> None:
        with self._query:
            self._query.reply_err(msgpack.packb([error.code, str(error)]), encoding=ERROR)


class ZenohTransport:
    """Implements `Transport` on one Zenoh session."""

    def __init__(self, config: BusConfig, patience_s: float = math.inf) -> None:
        self._session = _open(config, patience_s)
        self._cell = f"medor/{config.cell}"
        self._tokens: dict[Instance, zenoh.LivelinessToken] = {}
        self._watches: list[Watch] = []
        self._declared: list[object] = []
        """Queryables and subscribers live as long as they are referenced."""

    def serve(self, instance: Instance, verb: str, offer: Callable[[Incoming], None]) -> None:
        key = f"{self._key(instance)}/{verb}"

        def on_query(query: zenoh.Query) -> None:
            offer(ZenohIncoming(query, key))

        # Not `complete`, a query would go to every replica that matches.
        self._declared.append(self._session.declare_queryable(key, Callback(on_query, indirect=False), complete=True))

    def on_cancel(self, instance: Instance, withdraw: Callable[[str], None]) -> None:
        self._listen(f"{self._key(instance)}/@cancel", lambda sample: withdraw(sample.payload.to_string()))

    def announce(self, instance: Instance) -> None:
        if instance not in self._tokens:
            self._tokens[instance] = self._session.liveliness().declare_token(self._alive(instance))

    def withdraw(self) -> None:
        for token in self._tokens.values():
            token.undeclare()
        self._tokens.clear()

    def on_presence(self, listener: Callable[[Instance, bool], None]) -> None:
        def changed(sample: zenoh.Sample) -> None:
            service, id, boot = str(sample.key_expr).split("/")[-3:]
            listener(Instance(service, id, boot), sample.kind == zenoh.SampleKind.PUT)

        watcher = self._session.liveliness().declare_subscriber(
            f"{self._cell}/alive/*/*/*", Callback(changed, indirect=False), history=True
        )
        self._declared.append(watcher)

    def ask(
        self, instance: Instance, verb: str, frame: bytes, attachment: bytes, timeout_s: float, mailbox: Mailbox
    ) -> None:
        def on_reply(reply: zenoh.Reply) -> None:
            mailbox.put(_answer(reply))

        try:
            self._session.get(
                f"{self._key(instance)}/{verb}",
                Callback(on_reply, lambda: mailbox.put(Answer("end")), indirect=False),
                payload=frame,
                encoding=FRAME,
                attachment=attachment,
                timeout=timeout_s + LATE_S,
                # Without it only the last of several replies is delivered.
                consolidation=zenoh.ConsolidationMode.NONE,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
        except zenoh.ZError as error:
            raise Unavailable(f"{verb} could not be sent: {error}") from error

    def cancel(self, instance: Instance, ask: str) -> None:
        """Cancelling a query on this side alone would not tell the server."""
        with contextlib.suppress(zenoh.ZError):
            self._session.put(
                f"{self._key(instance)}/@cancel", ask, congestion_control=zenoh.CongestionControl.BLOCK, express=True
            )

    def publish(self, name: str, frame: bytes, *, urgent: bool = False) -> None:
        """Drops rather than waits when the link is congested, except for what is urgent."""
        control = zenoh.CongestionControl
        try:
            self._session.put(
                f"{self._cell}/{name}",
                frame,
                encoding=FRAME,
                congestion_control=control.BLOCK if urgent else control.DROP,
                priority=zenoh.Priority.REAL_TIME if urgent else zenoh.Priority.DATA,
                express=urgent,
            )
        except zenoh.ZError as error:
            raise Unavailable(f"{name} could not be published: {error}") from error

    def subscribe(self, name: str, listener: Callable[[bytes], None]) -> "Watch":
        watch = Watch(self._session.declare_subscriber(f"{self._cell}/{name}", RingChannel(1)), name, listener)
        self._watches = [*(earlier for earlier in self._watches if earlier.alive), watch]
        return watch

    def on_heartbeat(self, listener: Callable[[bytes], None]) -> None:
        self._listen(f"{self._cell}/health/*/*", lambda sample: listener(sample.payload.to_bytes()))

    def close(self) -> None:
        closing = threading.Thread(target=self._session.close, name="closing", daemon=True)
        closing.start()
        closing.join(CLOSE_S)
        if closing.is_alive():
            logs.logger("bus").warning("the session did not close", seconds=CLOSE_S)
        for watch in self._watches:
            watch.join()

    def _listen(self, key: str, listener: Callable[[zenoh.Sample], None]) -> None:
        self._declared.append(self._session.declare_subscriber(key, Callback(listener, indirect=False)))

    def _key(self, instance: Instance) -> str:
        return f"{self._cell}/{instance.service}/{instance.id}/{instance.boot}"

    def _alive(self, instance: Instance) -> str:
        return f"{self._cell}/alive/{instance.service}/{instance.id}/{instance.boot}"


Frames = Handler[zenoh.Sample]


class Watch:
    """A subscription whose listener runs in a thread of its own."""

    def __init__(self, subscriber: zenoh.Subscriber[Frames], name: str, listener: Callable[[bytes], None]) -> None:
        self._subscriber = subscriber
        frames = subscriber.handler
        self._thread = threading.Thread(
            target=self._deliver, args=(frames, listener), name=f"watch {name}", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        with contextlib.suppress(zenoh.ZError):
            self._subscriber.undeclare()
        self.join()

    @property
    def alive(self) -> bool:
        return self._thread.is_alive()

    def join(self) -> None:
        """Wait for the thread to leave Zenoh: one that is inside it when the interpreter ends aborts the process."""
        if self._thread is not threading.current_thread():
            self._thread.join(JOIN_S)

    @staticmethod
    def _deliver(frames: Frames, listener: Callable[[bytes], None]) -> None:
        with contextlib.suppress(zenoh.ZError):  # raised when the subscriber or its session is closed
            while True:
                listener(frames.recv().payload.to_bytes())


def _open(config: BusConfig, patience_s: float) -> zenoh.Session:
    """A session as soon as there is a router, whoever starts first; interruptible every second."""
    deadline = time.monotonic() + patience_s
    while True:
        try:
            return zenoh.open(client_config(config))
        except zenoh.ZError as error:
            if time.monotonic() >= deadline:
                raise Unavailable(f"no router at {config.router}: {error}") from error
            logs.logger("bus").warning("waiting for the router", router=config.router)


def _answer(reply: zenoh.Reply) -> Answer:
    """Zenoh reports slowness as an error text; a missing or vanished server as no reply at all."""
    if reply.ok is not None:
        progress = reply.ok.attachment is not None and reply.ok.attachment.to_bytes() == PROGRESS
        return Answer("progress" if progress else "reply", reply.ok.payload.to_bytes())
    assert reply.err is not None
    content = reply.err.payload.to_bytes()
    if str(reply.err.encoding) == str(ERROR):
        code, message = msgpack.unpackb(content)
        return Answer("error", error=error_from(code, message))
    text = content.decode(errors="replace")
    if text == "Timeout":
        return Answer("error", error=Timeout("no answer by the deadline"))
    return Answer("error", error=Unavailable(f"the wire says: {text}"))
