"""Signs of life."""

from medor_wire.messages.base import Message


class Heartbeat(Message):
    """Health of one process, published at 1 Hz from its work loop."""

    service: str
    id: str
    boot: str
    ready: bool
    detail: str = ""
    busy: int = 0
    uptime_s: float = 0.0
