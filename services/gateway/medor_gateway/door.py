"""What every route shares: the bus, who may enter, and what is remembered."""

from collections.abc import Callable
from threading import Event
from typing import Annotated

from fastapi import Depends, Request
from prometheus_client import CollectorRegistry

from medor_gateway.auth import Keyring
from medor_gateway.config import Config
from medor_gateway.jobs import Jobs
from medor_gateway.records import EpisodeRecord, PlanRecord, Shelf
from medor_gateway.tracing import current_request_id
from medor_wire.bus import Bus
from medor_wire.endpoints import Endpoint
from medor_wire.endpoints import Reply as ReplyType
from medor_wire.endpoints import Request as RequestType
from medor_wire.messages import Message


class Door:
    """One gateway process."""

    def __init__(self, bus: Bus, config: Config) -> None:
        self.bus = bus
        self.config = config
        self.keyring = Keyring.parse(config.keys)
        self.registry = CollectorRegistry()
        self.plans: Jobs[PlanRecord] = Jobs(config.plans_at_once, config.plans_kept)
        self.episodes: Jobs[EpisodeRecord] = Jobs(config.episodes_at_once, config.episodes_kept)
        self.meshes = Shelf(config.meshes_kept)
        self.streams = 0

    def ask(
        self,
        endpoint: Endpoint[RequestType, ReplyType],
        request: RequestType,
        on_progress: Callable[[Message], None] | None = None,
        cancel: Event | None = None,
    ) -> ReplyType:
        """Ask over the bus under the HTTP request's id."""
        request_id = current_request_id.get() or None
        return self.bus.ask(endpoint, request, on_progress=on_progress, cancel=cancel, request_id=request_id)

    def close(self) -> None:
        """Cancel what runs."""
        self.plans.close()
        self.episodes.close()


async def _door(request: Request) -> Door:
    return request.app.state.door


DoorOf = Annotated[Door, Depends(_door)]
