"""Errors as RFC 9457 problem details: a status, a stable `code`, and in words what was expected and what came."""

import json
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import Match

from medor_gateway.tracing import current_request_id
from medor_wire import errors, logs
from medor_wire.errors import MedorError

MEDIA_TYPE = "application/problem+json"
RETRY_AFTER_S = 1

STATUS: dict[type[MedorError], int] = {
    MedorError: 500,
    errors.BadRequest: 400,
    errors.NoGarment: 422,
    errors.SeveralGarments: 422,
    errors.OutOfReach: 422,
    errors.ReconstructionFailed: 422,
    errors.NotFound: 404,
    errors.IdReused: 409,
    errors.Refused: 409,
    errors.OutcomeUnknown: 409,
    errors.Cancelled: 409,
    errors.Unavailable: 503,
    errors.Busy: 429,
    errors.Timeout: 504,
    errors.BadFrame: 502,
}
"""Of an error class and, unless listed themselves, of its children."""

ASKS = (429, 500, 502, 503, 504)
"""What any call that asks another service may come to."""

CODES = {400: "bad_request", 413: "too_large", 422: "invalid_request", 500: "internal"}
"""Codes of refusals that the door itself makes; elsewhere the status' own phrase."""


class FieldError(BaseModel):
    """One reason why a request does not fit the schema."""

    where: list[str | int]
    """Path into the request, e.g. `["body", "options", "candidates"]`."""
    message: str


class Problem(BaseModel):
    """RFC 9457 problem details."""

    type: str = Field(examples=["urn:medor:problem:no_garment"])
    title: str = Field(examples=["no garment"])
    status: int = Field(examples=[422])
    detail: str = Field(examples=["expected cloth in view, got 12 pixels above the table"])
    code: str = Field(description="Stable; the codes of the error tree.", examples=["no_garment"])
    retry: bool = Field(False, description="Whether asking the same again may succeed.")
    request_id: str = Field("", description="The same id stands in every service's log.")
    errors: list[FieldError] = []


def status_of(error: MedorError) -> int:
    """HTTP status of an error: that of its nearest listed ancestor."""
    return next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)


def problem(status: int, code: str, detail: str, *, retry: bool = False, errors: Sequence[FieldError] = ()) -> Problem:
    """The problem with this status and code."""
    return Problem(
        type=f"urn:medor:problem:{code}",
        title=code.replace("_", " "),
        status=status,
        detail=detail,
        code=code,
        retry=retry,
        request_id=current_request_id.get(),
        errors=list(errors),
    )


def problem_of(error: MedorError) -> Problem:
    """A reported error as a problem."""
    return problem(status_of(error), error.code, str(error) or error.code, retry=error.retry)


def respond(content: Problem, headers: dict[str, str] | None = None) -> Response:
    """The problem as a response; `Retry-After` goes with everything that may be asked again."""
    retry = {"Retry-After": str(RETRY_AFTER_S)} if content.retry else {}
    body = json.dumps(content.model_dump(mode="json"))  # ASCII: a request may hold text that is not valid Unicode
    return Response(body, content.status, {**retry, **(headers or {})}, media_type=MEDIA_TYPE)


def install(app: FastAPI) -> None:
    """Answer every failure of `app` with a problem."""
    app.add_exception_handler(MedorError, _medor)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(Exception, _unexpected)


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI `responses` of an operation that may answer with these problems."""
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": HTTPStatus(status).phrase, "content": content} for status in statuses}


def schemas() -> dict[str, Any]:
    """The OpenAPI component schemas that `documented` refers to."""
    schema = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
    return {**schema.pop("$defs"), "Problem": schema}


def _medor(request: Request, error: Exception) -> Response:
    assert isinstance(error, MedorError)
    return respond(problem_of(error))


def _invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    reasons = [FieldError(where=[_plain(part) for part in e["loc"]], message=e["msg"]) for e in error.errors()]
    detail = "; ".join(f"{'.'.join(map(str, r.where))}: {r.message}" for r in reasons[:3])
    return respond(problem(422, CODES[422], detail, errors=reasons[:20]))


def _plain(part: str | int) -> str | int:
    return part if isinstance(part, int) else part[:64].encode("utf-8", "replace").decode()


def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    code = CODES.get(error.status_code) or HTTPStatus(error.status_code).phrase.lower().replace(" ", "_")
    headers = dict(error.headers or {})
    if error.status_code == 405:
        headers["Allow"] = ", ".join(_allowed(request))
    return respond(problem(error.status_code, code, str(error.detail)), headers)


def _allowed(request: Request) -> list[str]:
    """Methods that some route takes at this path. Starlette names those of the first route only."""
    scopes = ({**request.scope, "method": method} for method in ("DELETE", "GET", "POST"))
    return [s["method"] for s in scopes if any(r.matches(s)[0] is Match.FULL for r in request.app.routes)]


def _unexpected(request: Request, error: Exception) -> Response:
    where = f"{request.method} {request.url.path}"
    logs.logger("http").error("defect", endpoint=where, request=current_request_id.get(), exc_info=error)
    return respond(problem(500, CODES[500], "a defect in the gateway; the traceback is in its log"))
