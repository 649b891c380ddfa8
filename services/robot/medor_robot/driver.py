"""The real cell: what the camera sees, what the arm may do, and doing it."""

import time
from collections.abc import Callable
from typing import Protocol

from medor_robot.waypoints import Waypoint, waypoints
from medor_robot.workspace import Workspace
from medor_wire import endpoints
from medor_wire import messages as m
from medor_wire.bus import Call
from medor_wire.endpoints import Topic
from medor_wire.motion import Check, Motion

Tell = Callable[[Topic, m.Message], None]


class Camera(Protocol):
    @property
    def detail(self) -> str: ...

    def capture(self) -> m.DepthView: ...


class Arm(Protocol):
    detail: str

    def follow(self, stations: list[Waypoint], check: Check) -> bool: ...


class Driver:
    """Handlers of `robot/*`; implements `medor_wire.cell.Cell`.

    Args:
        motion: gate of everything that moves.
        arm: follows waypoints, says whether it grasped.
        camera: takes depth views.
        workspace: limits.
        tell: called with what observers may watch.
    """

    def __init__(self, motion: Motion, arm: Arm, camera: Camera, workspace: Workspace, tell: Tell) -> None:
        self._motion = motion
        self._arm = arm
        self._camera = camera
        self._workspace = workspace
        self._tell = tell

    def capture(self, request: m.Empty, call: Call) -> m.DepthView:
        view = self._camera.capture()
        self._tell(endpoints.DEPTH, view)
        return view

    def status(self, request: m.Empty, call: Call) -> m.CellStatus:
        return self._motion.status("robot", detail=f"{self._arm.detail}; {self._camera.detail}")

    def reach(self, request: m.ReachRequest, call: Call) -> m.Reach:
        """Ends within the workspace; it is convex, so that the pull between them is too."""
        reachable = self._workspace.contains(request.points)
        if request.places is not None:
            reachable &= self._workspace.contains(request.places)
        return m.Reach(reachable=reachable)

    def act(self, request: m.ActRequest, call: Call) -> m.ActOutcome:
        """One pick-and-place within the workspace.

        Raises:
            OutOfReach, BadRequest: against a limit of the workspace; nothing has moved.
            Refused: what `Motion.act` says.
        """
        try:
            outcome = self._motion.act(request, call, allow=self._allow, move=self._move)
        finally:
            self._tell(endpoints.CELL, self.status(m.Empty(), call))
        self._tell(endpoints.ACTION, outcome)
        return outcome

    def _allow(self, request: m.ActRequest) -> None:
        self._workspace.check(request.pick, request.place)

    def _move(self, request: m.ActRequest, check: Check) -> m.ActOutcome:
        start = time.perf_counter()
        self._tell(endpoints.CELL, self.status(m.Empty(), Call()))
        grasped = self._arm.follow(waypoints(request.pick, request.place), check)
        seconds = time.perf_counter() - start
        return m.ActOutcome(action_id=request.action_id, grasped=grasped, seconds=seconds, detail=self._arm.detail)
