"""Who is alive and ready."""

from typing import Literal

from pydantic import Field

from medor_gateway.http_models.base import Report


class InstanceHealth(Report):
    id: str
    ready: bool = Field(description="Alive, warm, and heard of lately.")
    age_s: float | None = Field(description="Since its last heartbeat.")
    busy: int
    uptime_s: float
    detail: str


class ServiceHealth(Report):
    ready: bool = Field(description="At least one instance is.")
    instances: list[InstanceHealth]


class Readiness(Report):
    ready: bool = Field(description="All required services are.")
    services: dict[str, ServiceHealth]


class Alive(Report):
    status: Literal["ok"] = "ok"
    version: str
    uptime_s: float
