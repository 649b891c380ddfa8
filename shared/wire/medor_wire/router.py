"""The Zenoh router: the one member of a cell that listens; every service is a client of it.

A router of its own is the process `python -m medor_wire.router`; the launcher hosts one inside itself.
"""

import contextlib
import threading
from collections.abc import Iterator

import zenoh

from medor_wire.bus import join
from medor_wire.config import BusConfig, Settings
from medor_wire.zenoh_config import router_config

CLOSE_S = 1.0
"""Closing a session can hang on a stuck peer; nothing is lost by not waiting longer."""


class Config(Settings, section="router"):
    listen: str = "tcp/127.0.0.1:7447"
    """Zenoh endpoint to listen on. Whoever reaches it can move the robot: loopback unless the network is trusted."""


@contextlib.contextmanager
def routing(listen: str, bus: BusConfig | None = None) -> Iterator[None]:
    """Routes between the clients of `listen` while the context lasts; `bus` says whether with TLS.

    Raises:
        zenoh.ZError: the address cannot be listened on.
    """
    bus = bus or BusConfig()
    session = zenoh.open(router_config(listen, shared_memory=bus.shared_memory, tls=bus.tls))
    try:
        yield
    finally:
        closing = threading.Thread(target=session.close, daemon=True)
        closing.start()
        closing.join(CLOSE_S)


def main(config: Config) -> None:
    """Route until SIGTERM or SIGINT; a member of the bus itself, so that its health shows like everyone's."""
    with routing(config.listen, config.bus), join("router", config.bus) as bus:
        bus.ready()
        bus.run()


if __name__ == "__main__":
    main(Config.from_command_line())
