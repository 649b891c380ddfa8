"""Who may do what on a bus with certificates: nothing, unless it is written here.

A peer is known by the common name of its certificate, which is the name of its service. Only the planner may lease
and move the robot; only the cell may answer for it. A peer that is denied hears nothing at all.
"""

from typing import Any

SERVES = {
    "recon": ("recon",),
    "dynamics": ("dynamics",),
    "planner": ("planner",),
    "sim": ("sim", "robot"),
    "robot": ("robot",),
    "gateway": ("gateway",),
    "router": ("router",),
}
"""The services a peer may answer for."""

LOOK = ("robot/capture", "robot/status", "robot/reach")
ASKS = {
    "planner": ("recon/*", "dynamics/*", "sim/*", "robot/lease", "robot/act", *LOOK),
    "gateway": ("planner/*", "recon/*", "dynamics/*", "sim/*", "robot/clear_stop", *LOOK),
}
"""The endpoints a peer may ask."""

TOPICS = ("sensor/*", "mesh", "cell", "action", "safety/estop")
EVERYONE = "everyone"
COMMAND_BYTES = 16 << 10
"""No command to a robot is larger."""

Rule = dict[str, Any]


def access_control() -> dict[str, Any]:
    """The router's access control: default deny."""
    own = {peer: [*_serve(peer), *_ask(peer)] for peer in SERVES}
    rules = {EVERYONE: _watch(), **own}
    subjects = [{"id": peer, "cert_common_names": [peer]} for peer in SERVES]
    everyone = {"id": EVERYONE, "cert_common_names": [*SERVES, "viewer"]}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for group in rules.values() for rule in group],
        "subjects": [everyone, *subjects],
        "policies": [{"rules": [rule["id"] for rule in group], "subjects": [id]} for id, group in rules.items()],
    }


def command_limit() -> list[dict[str, Any]]:
    """Drops what is too large to be a command before it reaches a robot."""
    return [
        {
            "id": "commands",
            "flows": ["ingress"],
            "messages": ["query", "put"],
            "key_exprs": ["medor/*/robot/*/*/act", "medor/*/robot/*/*/lease", "medor/*/safety/**"],
            "size_limit": COMMAND_BYTES,
        }
    ]


def _serve(peer: str) -> list[Rule]:
    """Be there, be asked and answer; publish."""
    # `*` does not match `@cancel`: a chunk that begins with @ must be named.
    verbs = [f"medor/*/{service}/*/*/{verb}" for service in SERVES[peer] for verb in ("*", "@cancel")]
    presence = [f"medor/*/alive/{service}/*/*" for service in SERVES[peer]]
    spoken = [f"medor/*/{topic}" for topic in TOPICS] + ["medor/*/health/*/*"]
    return [
        _allow(f"{peer}-serve-in", "ingress", verbs, "reply", "declare_queryable", "declare_subscriber"),
        _allow(f"{peer}-serve-out", "egress", verbs, "query", "put"),
        _allow(f"{peer}-presence", "ingress", presence, "liveliness_token"),
        _allow(f"{peer}-publish", "ingress", spoken, "put"),
    ]


def _ask(peer: str) -> list[Rule]:
    """Ask, cancel and be answered."""
    asked = [tuple(endpoint.split("/")) for endpoint in ASKS.get(peer, ())]
    if not asked:
        return []
    verbs = [f"medor/*/{service}/*/*/{verb}" for service, verb in asked]
    cancel = sorted({f"medor/*/{service}/*/*/@cancel" for service, _ in asked})
    return [
        _allow(f"{peer}-ask", "ingress", verbs, "query"),
        _allow(f"{peer}-cancel", "ingress", cancel, "put"),
        _allow(f"{peer}-answers", "egress", [*verbs, *cancel], "reply", "declare_queryable", "declare_subscriber"),
    ]


def _watch() -> list[Rule]:
    """See who is there, how they are and what is published."""
    seen = [f"medor/*/{topic}" for topic in TOPICS] + ["medor/*/health/*/*"]
    alive = ["medor/*/alive/**"]
    return [
        _allow("watch-in", "ingress", seen, "declare_subscriber"),
        _allow("watch-out", "egress", seen, "put", "declare_subscriber"),
        _allow("alive-in", "ingress", alive, "liveliness_query", "declare_liveliness_subscriber"),
        _allow("alive-out", "egress", alive, "liveliness_token", "reply"),
    ]


def _allow(id: str, flow: str, keys: list[str], *messages: str) -> Rule:
    return {"id": id, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": keys}
