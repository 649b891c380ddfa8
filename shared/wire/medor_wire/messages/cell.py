"""The cell; the simulated and the real one answer alike."""

from typing import Annotated, Literal

from pydantic import Field

from medor_wire.arrays import Shape, Vector3
from medor_wire.messages.base import F4, Bools, Category, Executor, Message
from medor_wire.messages.view import CameraInfo


class LeaseRequest(Message):
    holder: str = Field(min_length=1, max_length=128)
    """Presence id of the asker: when it vanishes the robot stops and the lease is revoked."""
    action: Literal["acquire", "renew", "release"] = "acquire"
    epoch: int = 0
    """The epoch being renewed or released."""


class Lease(Message):
    epoch: int
    """Fencing epoch: an act with an older one is refused."""
    ttl_s: float


class ActRequest(Message):
    """One pick-and-place. The same `action_id` again gets the recorded outcome and moves nothing."""

    action_id: str = Field(min_length=1, max_length=128)
    epoch: int
    pick: Vector3
    place: Vector3
    executor: Executor = "picker"


class ActOutcome(Message):
    action_id: str
    grasped: bool
    replayed: bool = False
    """True when this is the recorded outcome of an earlier call."""
    arm_reached: bool = True
    """False when the arm could not follow the flying picker to the end of the path."""
    seconds: float = 0.0
    detail: str = ""
    """What else there is to say, such as that nothing moved in a dry run."""


class ReachRequest(Message):
    """Whether the tool gets to points [m] or, with `places`, whether pulls from points to places can be done."""

    points: Annotated[F4, Shape("K 3", "f4")]
    places: Annotated[F4, Shape("K 3", "f4")] | None = None
    executor: Executor = "picker"


class Reach(Message):
    reachable: Annotated[Bools, Shape("K", "?")]


class CellStatus(Message):
    cell: Literal["sim", "robot"]
    state: Literal["idle", "moving", "stopped"]
    """`stopped`: the e-stop is latched."""
    category: Category | None = None
    """Of the garment on the table, where the cell knows it."""
    holder: str | None = None
    epoch: int = 0
    actions: int = 0
    """Actions executed since the start."""
    camera: CameraInfo | None = None
    detail: str = ""


class ClearStop(Message):
    """Operator's order to clear a latched e-stop."""

    operator: str = Field(min_length=1, max_length=128)


class EmergencyStop(Message):
    reason: str = ""
    source: str = ""
