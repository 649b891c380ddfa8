"""Every function of Medor that can be asked over the wire, and every stream that can be watched. One page."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from medor_wire import messages as m
from medor_wire.messages import Message

Request = TypeVar("Request", bound=Message)
Reply = TypeVar("Reply", bound=Message)
Content = TypeVar("Content", bound=Message)


@dataclass(frozen=True)
class Endpoint(Generic[Request, Reply]):
    """A question and its answer. `name` is `service/verb`."""

    name: str
    request: type[Request]
    reply: type[Reply]
    timeout_s: float
    progress: type[Message] | None = None
    """Type of the messages streamed before the reply, if any."""
    read_only: bool = True
    """Reads are asked again when nobody answered; anything with a side effect never is."""
    routine: bool = False
    """Asked many times a second: its successes are counted but not logged."""

    @property
    def service(self) -> str:
        return self.name.split("/")[0]

    @property
    def verb(self) -> str:
        return self.name.split("/")[1]


@dataclass(frozen=True)
class Topic(Generic[Content]):
    """A stream that anyone may watch."""

    name: str
    content: type[Content]
    urgent: bool = False
    """Overtakes everything else on the wire."""


RECONSTRUCT = Endpoint(
    "recon/reconstruct",
    m.ReconstructRequest,
    m.Reconstruction,
    timeout_s=30,
    progress=m.ReconstructProgress,
)

ROLLOUT = Endpoint(
    "dynamics/rollout",
    m.RolloutRequest,
    m.Rollouts,
    timeout_s=600,
    progress=m.RolloutProgress,
)
FLATTEN = Endpoint("dynamics/flatten", m.FlattenRequest, m.GoalSet, timeout_s=120)

PLAN = Endpoint("planner/plan", m.PlanRequest, m.Plan, timeout_s=1200, progress=m.PlanProgress)
EXECUTE = Endpoint("planner/execute", m.ExecuteRequest, m.ActOutcome, timeout_s=300, read_only=False)
EPISODE = Endpoint(
    "planner/episode",
    m.EpisodeRequest,
    m.Episode,
    timeout_s=7200,
    progress=m.EpisodeProgress,
    read_only=False,
)

CAPTURE = Endpoint("robot/capture", m.Empty, m.DepthView, timeout_s=10)
STATUS = Endpoint("robot/status", m.Empty, m.CellStatus, timeout_s=5)
REACH = Endpoint("robot/reach", m.ReachRequest, m.Reach, timeout_s=30)
LEASE = Endpoint("robot/lease", m.LeaseRequest, m.Lease, timeout_s=5, read_only=False, routine=True)
ACT = Endpoint("robot/act", m.ActRequest, m.ActOutcome, timeout_s=300, read_only=False)
CLEAR_STOP = Endpoint("robot/clear_stop", m.ClearStop, m.CellStatus, timeout_s=5, read_only=False)

RESET = Endpoint("sim/reset", m.ResetRequest, m.Score, timeout_s=600, read_only=False)
SCORE = Endpoint("sim/score", m.Empty, m.Score, timeout_s=30)
TRUTH = Endpoint("sim/truth", m.Empty, m.Truth, timeout_s=30)
UPLOAD_GARMENT = Endpoint("sim/upload_garment", m.UploadGarment, m.GarmentId, timeout_s=60, read_only=False)

ENDPOINTS = (
    RECONSTRUCT, ROLLOUT, FLATTEN, PLAN, EXECUTE, EPISODE, CAPTURE, STATUS, REACH, LEASE, ACT, CLEAR_STOP,
    RESET, SCORE, TRUTH, UPLOAD_GARMENT,
)  # fmt: skip

DEPTH = Topic("sensor/depth", m.DepthView)
MESH = Topic("mesh", m.ClothMesh)
CELL = Topic("cell", m.CellStatus)
ACTION = Topic("action", m.ActOutcome)
STOP = Topic("safety/estop", m.EmergencyStop, urgent=True)

TOPICS = (DEPTH, MESH, CELL, ACTION, STOP)
