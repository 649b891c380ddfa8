"""Locked Zenoh configurations: one router, everyone else its client; no discovery, no open doors.

Zenoh's defaults listen on every interface, join multicast and gossip, and forget a peer after 10 s.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import zenoh

from medor_wire.access import access_control, command_limit
from medor_wire.config import BusConfig

LEASE_MS = 2000
"""A silent peer is gone after this long."""
MAX_MESSAGE_BYTES = 128 << 20
SHARED_MEMORY_FROM_BYTES = 32 << 10


def client_config(config: BusConfig) -> zenoh.Config:
    """A client of `config.router` that listens on nothing.

    Opening it without the router fails after a second; once open it reconnects for as long as it takes.
    """
    connect = {
        "endpoints": [config.router],
        "timeout_ms": 1000,
        "retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 1.5},
    }
    return _locked(
        {"mode": "client", "connect": connect, "listen/endpoints": []}
        | _transport(config.router, config.shared_memory, config.tls)
    )


def router_config(listen: str, *, shared_memory: bool = True, tls: Path | None = None) -> zenoh.Config:
    """A router listening on `listen` alone, e.g. `tcp/127.0.0.1:7447`; `zenoh.open` of it hosts the router.

    With certificates it lets every peer do only what `access` says.
    """
    secured = {"access_control": access_control()} if tls is not None else {}
    return _locked(
        {
            "mode": "router",
            "listen/endpoints": [listen],
            "connect/endpoints": [],
            "adminspace/enabled": False,
            # Without it 150 idle connections lock new clients out for 10 s.
            "transport/unicast/accept_timeout": LEASE_MS,
            "transport/unicast/max_sessions": 64,
            "low_pass_filter": command_limit(),
        }
        | secured
        | _transport(listen, shared_memory, tls)
    )


def _transport(endpoint: str, shared_memory: bool, tls: Path | None) -> dict[str, Any]:
    optimization = {"enabled": True, "pool_size": 64 << 20, "message_size_threshold": SHARED_MEMORY_FROM_BYTES}
    settings: dict[str, Any] = {
        "transport/link/protocols": [endpoint.split("/")[0]],
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/keep_alive": 4,
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES,
        "transport/shared_memory/enabled": shared_memory,
    }
    if shared_memory:
        settings["transport/shared_memory/transport_optimization"] = optimization
    return settings | (_mutual_tls(tls) if tls is not None else {})


def _mutual_tls(folder: Path) -> dict[str, Any]:
    """Both sides show a certificate of the same authority."""
    own = {
        f"{side}_{kind}": str(folder / f"{name}.pem")
        for side in ("listen", "connect")
        for kind, name in (("private_key", "key"), ("certificate", "cert"))
    }
    authority = {"root_ca_certificate": str(folder / "ca.pem"), "enable_mtls": True, "verify_name_on_connect": True}
    return {"transport/link/tls": own | authority}


def _locked(settings: Mapping[str, Any]) -> zenoh.Config:
    config = zenoh.Config()
    closed = {"scouting/multicast/enabled": False, "scouting/gossip/enabled": False}
    for key, value in (closed | dict(settings)).items():
        config.insert_json5(key, json.dumps(value))
    return config
