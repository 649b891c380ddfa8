"""The rollout verb: a request goes to the backend it names."""

from collections.abc import Mapping
from typing import Protocol

from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import RolloutRequest, Rollouts


class Backend(Protocol):
    """One way to predict what candidates do to a cloth."""

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts: ...


class Roller:
    """All backends of this service, by name."""

    def __init__(self, backends: Mapping[str, Backend]) -> None:
        self._backends = backends

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._backends)

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts:
        """Raises `BadRequest` for a backend that is not here, else what the backend raises."""
        if request.backend not in self._backends:
            raise BadRequest(f"expected a backend of {', '.join(self._backends)}, got {request.backend!r}")
        return self._backends[request.backend].roll_out(request, call)
