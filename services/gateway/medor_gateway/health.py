"""`/healthz`, `/readyz`, `/metrics`: this process, the services behind it, and figures for Prometheus."""

import time
from typing import Any

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from medor_gateway.auth import READ
from medor_gateway.door import DoorOf
from medor_gateway.http_models import Alive, InstanceHealth, Readiness, ServiceHealth
from medor_gateway.version import VERSION
from medor_wire.bus import Bus, Health

router = APIRouter(tags=["health"])

STARTED = time.monotonic()


@router.get("/healthz")
async def healthz() -> Alive:
    """This process answers. Says nothing about the services behind it."""
    return Alive(version=VERSION, uptime_s=time.monotonic() - STARTED)


@router.get("/readyz", responses={503: {"model": Readiness, "description": "Something required is not ready."}})
async def readyz(door: DoorOf, response: Response) -> Readiness:
    """Whether every required service is present, warm, and was heard of in the last seconds."""
    found = readiness(door.bus, door.config.required_services, door.config.heartbeat_age_s)
    if not found.ready:
        response.status_code = 503
        response.headers["Retry-After"] = "1"
    return found


@router.get("/metrics", dependencies=[READ], response_class=Response, responses={200: {"content": {"text/plain": {}}}})
async def metrics(door: DoorOf) -> Response:
    """Prometheus exposition."""
    return Response(generate_latest(door.registry), media_type=CONTENT_TYPE_LATEST)


def readiness(bus: Bus, services: tuple[str, ...], oldest_s: float) -> Readiness:
    """What presence and heartbeats say about services.

    Args:
        oldest_s: a heartbeat older than this says nothing about now.
    """
    found = {service: _service(bus, service, oldest_s) for service in services}
    return Readiness(ready=all(health.ready for health in found.values()), services=found)


def _service(bus: Bus, service: str, oldest_s: float) -> ServiceHealth:
    beats = {(beat.service, beat.id, beat.boot): beat for beat in bus.health().values()}
    instances = [
        InstanceHealth(id=instance.id, **_beat(beats.get((service, instance.id, instance.boot)), oldest_s))
        for instance in bus.instances(service)
    ]
    return ServiceHealth(ready=any(instance.ready for instance in instances), instances=instances)


def _beat(beat: Health | None, oldest_s: float) -> dict[str, Any]:
    if beat is None:
        return {"ready": False, "age_s": None, "busy": 0, "uptime_s": 0.0, "detail": "present, no heartbeat yet"}
    fresh = beat.age_s <= oldest_s
    detail = beat.detail if fresh else f"present, but silent for {beat.age_s:.1f} s"
    return {
        "ready": beat.ready and fresh,
        "age_s": beat.age_s,
        "busy": beat.busy,
        "uptime_s": beat.uptime_s,
        "detail": detail,
    }
