"""No request body may be larger than its operation has use for."""

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SMALL = 1 << 20
LARGE = {"/plan": 96 << 20, "/cell/garment": 64 << 20}
"""Bytes: an observation (two base64 PNGs) and a mesh file; everything else is small."""


class BodyLimit:
    """ASGI middleware: refuses a body when it says it is too large, or as soon as it turns out to be."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        limit, received = LARGE.get(scope["path"], SMALL), 0
        announced = dict(scope["headers"]).get(b"content-length", b"0")

        async def counted() -> Message:
            nonlocal received
            if announced.isdigit() and int(announced) > limit:
                raise _too_large(limit)
            message = await receive()
            received += len(message.get("body", b""))
            if received > limit:
                raise _too_large(limit)
            return message

        await self.app(scope, counted, send)


def _too_large(limit: int) -> HTTPException:
    return HTTPException(413, f"expected a body of at most {limit} bytes", {"Connection": "close"})
