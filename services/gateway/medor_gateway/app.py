"""The HTTP door as an ASGI application: every route, limit and error answer, joined to one bus."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from starlette.responses import HTMLResponse, Response

from medor_gateway import cell, episodes, health, meshes, plans, problem
from medor_gateway.config import Config
from medor_gateway.door import Door
from medor_gateway.limits import BodyLimit
from medor_gateway.tracing import Tracing
from medor_gateway.version import VERSION
from medor_wire.bus import Bus

PAGE = Path(__file__).with_name("page.html")
PAGE_POLICY = (
    "default-src 'none'; img-src 'self' blob: data:; connect-src 'self'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)


def create_app(bus: Bus, config: Config) -> FastAPI:
    """The door to the cell that `bus` reaches.

    Raises:
        ValueError: API keys that cannot be used.
    """
    door = Door(bus, config)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        yield
        door.close()

    app = FastAPI(
        title="Medor",
        version=VERSION,
        description="Unfold a crumpled garment: look, plan, act. SI units; errors are RFC 9457 problems.",
        lifespan=lifespan,
        docs_url=None,  # their assets come from elsewhere
        redoc_url=None,
    )
    app.state.door = door
    for router in (cell.router, plans.router, episodes.router, meshes.router, health.router):
        app.include_router(router)
    app.add_api_route("/", _page, include_in_schema=False)
    problem.install(app)
    app.add_middleware(BodyLimit)
    app.add_middleware(Tracing, registry=door.registry)
    app.openapi = partial(_openapi, app)  # type: ignore[method-assign]
    return app


async def _page() -> Response:
    return HTMLResponse(PAGE.read_text(), headers={"Content-Security-Policy": PAGE_POLICY})


def _openapi(app: FastAPI) -> dict[str, Any]:
    """The OpenAPI document: FastAPI's, with our problem in place of its own error, and keys only where asked for."""
    if app.openapi_schema is None:
        schema = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
        schemas = schema["components"]["schemas"]
        schemas.pop("HTTPValidationError", None)
        schemas.pop("ValidationError", None)
        schemas |= problem.schemas()
        for operation in (o for path in schema["paths"].values() for o in path.values()):
            _tell_keys(operation, keys_set=bool(app.state.door.keyring.scopes))
        app.openapi_schema = schema
    return app.openapi_schema


def _tell_keys(operation: dict[str, Any], keys_set: bool) -> None:
    """Say what a guarded operation answers to those who may not; an open door asks for no key."""
    if "security" in operation:
        operation["responses"] |= {str(status): told for status, told in problem.documented(401, 403).items()}
    if not keys_set:
        operation.pop("security", None)
