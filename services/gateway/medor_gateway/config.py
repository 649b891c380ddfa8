"""Where the door stands and how much it takes."""

from medor_wire.config import Settings


class Config(Settings, section="gateway"):
    """The HTTP door of a Medor cell."""

    host: str = "127.0.0.1"
    """Address to listen on. Anything but loopback needs API keys."""
    port: int = 8080
    keys: str = ""
    """`KEY=SCOPE+SCOPE,…` with scopes read, plan, robot:move. Give it as MEDOR_GATEWAY__KEYS, not as an argument."""
    required_services: tuple[str, ...] = ("recon", "dynamics", "planner", "robot")
    """What `/readyz` waits for."""
    heartbeat_age_s: float = 2.5
    """A service not heard of for longer is not ready."""
    plans_at_once: int = 4
    plans_kept: int = 64
    episodes_at_once: int = 4
    episodes_kept: int = 32
    meshes_kept: int = 512
    streams_at_once: int = 32
    """Followers of episode events."""
