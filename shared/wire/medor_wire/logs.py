"""Logs: JSON lines, or readable on a terminal; one line per request. Everything goes to stderr."""

import logging
import sys
from typing import Any, Literal

import structlog
from structlog.tracebacks import ExceptionDictTransformer

TRACEBACKS = structlog.processors.ExceptionRenderer(ExceptionDictTransformer(show_locals=False))
"""Without the values of local variables: they hold API keys and whole images."""


def configure(form: Literal["auto", "console", "json"] = "auto", **context: str) -> None:
    """Set the process' log up; `context` (e.g. the process' id) stands in every line."""
    readable = form == "console" or (form == "auto" and sys.stderr.isatty())
    last: list[Any] = (
        [structlog.dev.ConsoleRenderer(exception_formatter=structlog.dev.plain_traceback)]
        if readable
        else [TRACEBACKS, structlog.processors.JSONRenderer()]
    )
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            lambda _, __, event: {**context, **event},
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            *last,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        # Looked up at every line: a test runner exchanges the stream behind our back.
        logger_factory=lambda *_: structlog.PrintLogger(sys.stderr),
        cache_logger_on_first_use=False,
    )


def logger(name: str) -> Any:
    """A logger whose lines say which part of the process speaks."""
    return structlog.get_logger().bind(part=name)


def request(endpoint: str, request_id: str, seconds: float, outcome: str, *, routine: bool = False) -> None:
    """The one line of a request; of a routine one only if it failed."""
    level = "error" if outcome == "internal" else "debug" if routine and outcome == "ok" else "info"
    ms = round(1e3 * seconds, 2)
    getattr(logger("request"), level)("request", endpoint=endpoint, request=request_id, ms=ms, outcome=outcome)


def defect(endpoint: str, request_id: str) -> None:
    """The traceback of the exception being handled: it never crosses the wire."""
    logger("request").exception("defect", endpoint=endpoint, request=request_id)
