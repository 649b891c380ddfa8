"""Is this process well? `python -m medor_wire.health`: exit code 0 or 1, for a container's health check.

Asks the process' own metrics page (`MEDOR_BUS__METRICS_PORT`) when it has one, else listens for its heartbeat on the
bus (`MEDOR_BUS__ID`, or any process when that is empty).
"""

import re
import sys
import time
import urllib.error
import urllib.request

from medor_wire.bus import join
from medor_wire.config import BusConfig, Settings
from medor_wire.errors import Unavailable

STALE_S = 5.0
"""A heartbeat older than this is a process that is stuck."""
LISTEN_S = 3.0


def fault_by_metrics(port: int, host: str = "127.0.0.1") -> str | None:
    """What is wrong with the process behind a metrics page, None if nothing."""
    try:
        with urllib.request.urlopen(f"http://{host}:{port}/metrics", timeout=2) as page:
            figures = dict(re.findall(r"^medor_(ready|heartbeat_timestamp_seconds) (\S+)$", page.read().decode(), re.M))
    except (urllib.error.URLError, OSError) as error:
        return f"no metrics page on port {port}: {error}"
    age_s = time.time() - float(figures.get("heartbeat_timestamp_seconds", 0.0))
    return _fault(float(figures.get("ready", 0.0)) == 1.0, age_s, "")


def fault_by_bus(config: BusConfig) -> str | None:
    """What is wrong with the process `config.id`, as far as the bus knows."""
    try:
        joined = join("health", config.model_copy(update={"id": "", "metrics_port": 0}), patience_s=0)
    except Unavailable as error:
        return str(error)
    with joined as bus:
        deadline = time.monotonic() + LISTEN_S
        while time.monotonic() < deadline:
            beats = [beat for beat in bus.health().values() if config.id in ("", beat.id)]
            if beats:
                worst = min(beats, key=lambda beat: beat.ready)
                return _fault(worst.ready, worst.age_s, worst.detail)
            time.sleep(0.05)
    return f"no heartbeat of {config.id or 'anybody'} within {LISTEN_S:g} s"


def _fault(ready: bool, age_s: float, detail: str) -> str | None:
    if age_s > STALE_S:
        return f"last heartbeat {age_s:.0f} s ago"
    return None if ready else f"not ready {detail}".strip()


def main(config: BusConfig) -> int:
    fault = fault_by_metrics(config.metrics_port) if config.metrics_port else fault_by_bus(config)
    sys.stderr.write(f"{fault or 'well'}\n")
    return 0 if fault is None else 1


if __name__ == "__main__":
    sys.exit(main(Settings.from_environment().bus))
