"""The Zenoh router: the one member of a cell that listens; every service is a client of it.

A router of its own is the process `python -m medor_wire.router`; the launcher hosts one inside itself.
"""

import contextlib
import json
import signal
import threading
from collections.abc import Iterator

import zenoh

from medor_wire.config import Settings

CLOSE_S = 1.0
"""Closing a session can hang on a stuck peer; nothing is lost by not waiting longer."""


class Config(Settings, section="router"):
    listen: str = "tcp/127.0.0.1:7447"
    """Zenoh endpoint to listen on. Whoever reaches it can move the robot: loopback unless the network is trusted."""


def configuration(listen: str) -> zenoh.Config:
    """A router that listens on `listen` and nowhere else, finds nobody by itself and sees a dead client in 2 s."""
    config = zenoh.Config()
    for key, value in {
        "mode": "router",
        "listen/endpoints": [listen],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "adminspace/enabled": False,
        "transport/unicast/max_sessions": 256,
        "transport/unicast/accept_timeout": 2000,
        "transport/link/tx/lease": 2000,
        "transport/link/tx/keep_alive": 4,
        "transport/link/rx/max_message_size": 128 << 20,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return config


@contextlib.contextmanager
def routing(listen: str) -> Iterator[None]:
    """Routes between the clients of `listen` while the context lasts.

    Raises:
        zenoh.ZError: the address cannot be listened on.
    """
    session = zenoh.open(configuration(listen))
    try:
        yield
    finally:
        closing = threading.Thread(target=session.close, daemon=True)
        closing.start()
        closing.join(CLOSE_S)


def main(config: Config) -> None:
    """Route until SIGTERM or SIGINT."""
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    with routing(config.listen):
        stop.wait()


if __name__ == "__main__":
    main(Config.from_command_line())
