"""Who may do what: API keys with scopes, and on an open loopback door the browser's same-origin rules.

A key is given as `Authorization: Bearer KEY` or `X-API-Key: KEY`.
"""

import hashlib
import hmac
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Annotated, Literal, get_args

from fastapi import Depends, Request
from fastapi.params import Depends as Dependency
from fastapi.security import APIKeyHeader, HTTPAuthorizationCredentials, HTTPBearer
from starlette.exceptions import HTTPException

Scope = Literal["read", "plan", "robot:move"]
SCOPES: tuple[str, ...] = get_args(Scope)
SHORTEST_KEY = 16

BEARER = HTTPBearer(auto_error=False, description="An API key.")
API_KEY = APIKeyHeader(name="X-API-Key", auto_error=False, description="An API key.")


def is_loopback(host: str) -> bool:
    """Whether a host name or address can only be reached from this machine."""
    try:
        return host == "localhost" or ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


@dataclass(frozen=True)
class Keyring:
    """Known API keys as SHA-256, with what each may do. Without any the door is open."""

    scopes: dict[bytes, frozenset[str]]

    @classmethod
    def parse(cls, text: str) -> "Keyring":
        """From `KEY=SCOPE+SCOPE,KEY=…`.

        Raises:
            ValueError: an unknown scope, or a key too short to be a secret.
        """
        known: dict[bytes, frozenset[str]] = {}
        for number, entry in enumerate(filter(None, (part.strip() for part in text.split(","))), start=1):
            key, _, granted = entry.rpartition("=")
            scopes = frozenset(granted.split("+"))
            if len(key) < SHORTEST_KEY or not scopes <= set(SCOPES):
                raise ValueError(
                    f"API key {number}: expected KEY=SCOPE+SCOPE with a key of at least {SHORTEST_KEY} characters "
                    f"and scopes of {', '.join(SCOPES)}; got a key of {len(key)} characters and {sorted(scopes)}"
                )
            known[_digest(key)] = scopes
        return cls(known)

    def scopes_of(self, key: str) -> frozenset[str] | None:
        """What a key may do; None for an unknown one. Takes the same time whatever the key."""
        given, found = _digest(key), None
        for known, scopes in self.scopes.items():
            found = scopes if hmac.compare_digest(known, given) else found
        return found


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode("utf-8", "surrogateescape")).digest()


def requires(scope: Scope | None) -> Dependency:
    """The dependency of a call that needs a key with this scope (None: any key).

    While no keys are set, which only a door on loopback may do, everyone on this machine may do everything; web pages
    from elsewhere, which a browser on this machine may show, may not.
    """

    async def check(  # not `def`: that would take a thread of the pool, and a stop must not wait for one
        request: Request,
        bearer: Annotated[HTTPAuthorizationCredentials | None, Depends(BEARER)],
        api_key: Annotated[str | None, Depends(API_KEY)],
    ) -> None:
        keyring: Keyring = request.app.state.door.keyring
        if not keyring.scopes:
            same_origin(request)
            return
        granted = keyring.scopes_of(bearer.credentials if bearer else api_key or "")
        if granted is None:
            raise HTTPException(401, "expected a known API key", {"WWW-Authenticate": "Bearer"})
        if scope is not None and scope not in granted:
            raise HTTPException(403, f"expected a key with the scope {scope}, this one has {sorted(granted)}")

    return Depends(check)


def same_origin(request: Request) -> None:
    """Refuse what a foreign web page made the browser send: forged requests, rebound host names."""
    host, origin = request.headers.get("host", ""), request.headers.get("origin")
    name = host.rpartition(":")[0] if not host.endswith("]") and ":" in host else host
    if not is_loopback(name):
        raise HTTPException(403, f"expected a loopback Host while no API keys are set, got {host!r}")
    if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
        raise HTTPException(403, f"expected a request from this door's own pages, got one from {origin!r}")


ANY_KEY = requires(None)
READ = requires("read")
PLAN = requires("plan")
MOVE = requires("robot:move")
