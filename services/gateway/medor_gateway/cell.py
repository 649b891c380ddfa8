"""`/cell/*` and `/estop`: look at the cell, reset the simulated one, stop the robot."""

from functools import partial
from typing import Annotated, Literal

import anyio
from fastapi import APIRouter, Body, Header, Query, Response

from medor_cloth.picture import depth_picture, png_bytes
from medor_gateway.auth import ANY_KEY, MOVE, READ
from medor_gateway.door import DoorOf
from medor_gateway.http_models import (
    CellReport,
    ClearCommand,
    GarmentReport,
    Observation,
    ResetCommand,
    ScoreReport,
    StopCommand,
    StopReport,
)
from medor_gateway.problem import ASKS, documented
from medor_wire import endpoints
from medor_wire.messages import Category, ClearStop, EmergencyStop, Empty, UploadGarment

router = APIRouter(tags=["cell"])

STOP_THREADS = anyio.CapacityLimiter(4)
"""Apart from the pool that answers everything else, so that a stop never queues behind slow calls."""


@router.post("/cell/reset", dependencies=[MOVE], responses=documented(400, 404, 409, 413, 422, *ASKS))
def reset(command: ResetCommand, door: DoorOf) -> ScoreReport:
    """Put a garment on the table of the simulated cell: dropped, laid flat, or flat and then picked at."""
    return ScoreReport.of(door.ask(endpoints.RESET, command.message()))


@router.post("/cell/garment", status_code=201, dependencies=[MOVE], responses=documented(400, 413, 422, *ASKS))
def upload_garment(
    content: Annotated[bytes, Body(media_type="application/octet-stream", min_length=1)],
    category: Annotated[Category, Query()],
    file_type: Annotated[Literal["obj", "ply", "glb"], Query()],
    door: DoorOf,
) -> GarmentReport:
    """Give the simulated cell a garment: the bytes of a mesh file, canonical (worn) pose, metres, z up.

    `POST /cell/reset` takes the `garment_id` answered here.
    """
    garment = UploadGarment(content=content, file_type=file_type, category=category)
    return GarmentReport.of(door.ask(endpoints.UPLOAD_GARMENT, garment))


@router.get(
    "/cell/observation",
    dependencies=[READ],
    response_model=Observation,
    responses={200: {"content": {"image/png": {}}}} | documented(422, *ASKS),
)
def observation(
    door: DoorOf, accept: Annotated[str, Header(include_in_schema=False)] = "*/*"
) -> Observation | Response:
    """What the camera sees now: JSON with a 16-bit depth PNG, or with `Accept: image/png` a picture to look at."""
    view = door.ask(endpoints.CAPTURE, Empty())
    if "image/" in accept and "application/json" not in accept:
        return Response(
            png_bytes(depth_picture(view.depth)), media_type="image/png", headers={"Cache-Control": "no-store"}
        )
    return Observation.of(view)


@router.get("/cell/status", dependencies=[READ], responses=documented(422, *ASKS))
def status(door: DoorOf) -> CellReport:
    """Whether the cell is idle, moving or stopped, and who holds the robot."""
    return CellReport.of(door.ask(endpoints.STATUS, Empty()))


@router.post("/estop", status_code=202, tags=["safety"], dependencies=[ANY_KEY], responses=documented(400, 413, 422))
async def estop(door: DoorOf, command: StopCommand | None = None) -> StopReport:
    """Stop the robot. Latched in the cell until an operator clears it. A convenience, not a safety function."""
    stop = EmergencyStop(reason=command.reason if command else "", source="gateway")
    await anyio.to_thread.run_sync(partial(door.bus.publish, endpoints.STOP, stop), limiter=STOP_THREADS)
    return StopReport()


@router.post("/estop/clear", tags=["safety"], dependencies=[MOVE], responses=documented(400, 409, 413, 422, *ASKS))
def clear_estop(command: ClearCommand, door: DoorOf) -> CellReport:
    """An operator clears the latched stop."""
    return CellReport.of(door.ask(endpoints.CLEAR_STOP, ClearStop(operator=command.operator)))
