"""Gateway service: HTTP in, questions over the bus out."""

import signal

import uvicorn

from medor_gateway.app import create_app
from medor_gateway.auth import is_loopback
from medor_gateway.config import Config
from medor_wire.bus import join


def main(config: Config) -> None:
    if not is_loopback(config.host) and not config.keys:
        raise SystemExit(
            f"refusing to listen on {config.host} without API keys: set MEDOR_GATEWAY__KEYS=KEY=read+plan+robot:move "
            "(several separated by commas), or listen on 127.0.0.1"
        )
    # uvicorn leaves on SIGTERM and then raises it again, which must not end the process before it has left the bus.
    signal.signal(signal.SIGTERM, lambda *_: None)
    with join("gateway", config.bus) as bus:
        app = create_app(bus, config)
        bus.ready()
        uvicorn.run(
            app,
            host=config.host,
            port=config.port,
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=2,
        )


if __name__ == "__main__":
    main(Config.from_command_line())
