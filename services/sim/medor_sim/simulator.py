"""The simulated cell: answers as a robot does, plus what only a simulation can (reset, score, truth, upload)."""

import time
from collections.abc import Callable

import numpy as np

from medor_cloth.errors import ClothError
from medor_cloth.picker import pull
from medor_cloth.raster import rasterize
from medor_sim.grasp_failures import Grasp, GraspFailures
from medor_sim.panda import Motion as ArmMotion
from medor_sim.panda import plan
from medor_sim.picking import by_panda, by_picker
from medor_sim.reach_map import ReachMap
from medor_sim.scene import Pulled, Scene
from medor_sim.wardrobe import Wardrobe
from medor_sim.world import World
from medor_wire import endpoints
from medor_wire import messages as m
from medor_wire.bus import Call
from medor_wire.endpoints import Topic
from medor_wire.errors import BadRequest, OutOfReach, Refused
from medor_wire.motion import Check, Motion

Tell = Callable[[Topic, m.Message], None]


def _nobody(topic: Topic, message: m.Message) -> None:
    """Nobody watches."""


class Simulator:
    """Handlers of `robot/*` and `sim/*`. Reads see the scene before a running action until it has ended.

    Args:
        motion: gate of everything that moves.
        wardrobe: where garments come from.
        tell: called with what observers may watch, after every change.
        failures: how often grasps fail.
    """

    def __init__(
        self,
        motion: Motion,
        wardrobe: Wardrobe | None = None,
        tell: Tell = _nobody,
        failures: GraspFailures | None = None,
    ) -> None:
        self._motion = motion
        self._wardrobe = wardrobe or Wardrobe()
        self._tell = tell
        self._failures = failures or GraspFailures()
        self._planned: ArmMotion | None = None
        self._world = World()
        self._reach_map = ReachMap(self._world.arm)
        self._scene: Scene | None = None
        camera = self._world.camera
        self._camera_info = m.CameraInfo(
            K=camera.K, T_world_camera=camera.T_world_camera, width=camera.width, height=camera.height
        )

    # --- the robot's contract -------------------------------------------------------------------------------------

    def capture(self, request: m.Empty, call: Call) -> m.DepthView:
        """What the camera sees: the cloth only, 0 elsewhere. An empty table is all 0."""
        camera, scene = self._world.camera, self._scene
        shape = camera.height, camera.width
        depth, mask = np.zeros(shape, np.float32), np.zeros(shape, bool)
        if scene is not None:
            raster = rasterize(scene.cloth.positions, scene.piece.garment.faces, camera)
            depth, mask = raster.depth, raster.mask
        return m.DepthView(depth=depth, mask=mask, camera=self._camera_info, stamp_ns=time.time_ns())

    def status(self, request: m.Empty, call: Call) -> m.CellStatus:
        scene = self._scene
        category = scene.piece.category if scene else None
        return self._motion.status("sim", category=category, camera=self._camera_info)

    def reach(self, request: m.ReachRequest, call: Call) -> m.Reach:
        """What `act` would not refuse. The flying picker only asks that the joints allow both ends."""
        picks, places = request.points, request.points if request.places is None else request.places
        if request.executor == "panda":
            return m.Reach(reachable=self._reach_map.can_pull(picks, places))
        return m.Reach(reachable=self._reach_map.reachable(picks) & self._reach_map.reachable(places))

    def act(self, request: m.ActRequest, call: Call) -> m.ActOutcome:
        """One pick-and-place, by the flying picker or by the arm.

        Raises:
            OutOfReach: the pick, the place or, for the arm, the way between them; nothing has moved.
            Refused: the arm would collide, nothing lies on the table, or what `Motion.act` says; nothing has moved.
        """
        try:
            outcome = self._motion.act(request, call, allow=self._allow, move=self._move)
        finally:
            self._tell_scene()  # also after a motion that was stopped half way
        self._tell(endpoints.ACTION, outcome)
        return outcome

    # --- simulation only ------------------------------------------------------------------------------------------

    def reset(self, request: m.ResetRequest, call: Call) -> m.Score:
        """Lay a garment on the table. The same request gives the same scene.

        Raises:
            BadRequest: no such garment, or it cannot be brought into this state.
        """
        piece = (
            self._wardrobe.generated(request.category, request.garment_seed)
            if request.garment_id is None
            else self._wardrobe.uploaded(request.garment_id)
        )
        with self._motion.alone():
            call.check()
            try:
                self._scene = Scene.begin(piece, request.state, request.seed)
            except ClothError as error:
                raise BadRequest(f"{piece.id} cannot be brought into the state {request.state!r}: {error}") from error
        self._tell_scene()
        return self._require_scene().score()

    def score(self, request: m.Empty, call: Call) -> m.Score:
        return self._require_scene().score()

    def truth(self, request: m.Empty, call: Call) -> m.Truth:
        return self._require_scene().truth(self._world.camera)

    def upload_garment(self, request: m.UploadGarment, call: Call) -> m.GarmentId:
        """Take in a user's mesh, to be laid out by a later reset."""
        piece = self._wardrobe.add(request.content, request.file_type, request.category)
        garment = piece.garment
        return m.GarmentId(garment_id=piece.id, vertices=len(garment.vertices), faces=len(garment.faces))

    def close(self) -> None:
        self._world.close()

    # ----------------------------------------------------------------------------------------------------------------

    def _require_scene(self) -> Scene:
        if self._scene is None:
            raise Refused("nothing lies on the table: reset the cell first")
        return self._scene

    def _allow(self, request: m.ActRequest) -> None:
        """Plan what the arm would do, or see that the picker may."""
        self._require_scene()
        if request.executor == "panda":
            self._planned = plan(self._world.arm, request.pick, request.place)
            return
        self._planned = None
        for name, point in (("pick", request.pick), ("place", request.place)):
            if not self._reach_map.reachable(point[None])[0]:
                raise OutOfReach(f"{name}: the arm cannot bring its tool to {point.round(4).tolist()} m")

    def _move(self, request: m.ActRequest, check: Check) -> m.ActOutcome:
        start = time.perf_counter()
        self._tell(endpoints.CELL, self.status(m.Empty(), Call()))
        scene, planned = self._require_scene(), self._planned
        grasp = self._failures.draw(scene.picks, request.pick, request.place)
        if planned is None:
            pulled = by_picker(scene, request.pick, request.place, grasp, check)
        else:
            pulled = by_panda(scene, planned, grasp, check)
            self._stand(planned, pulled)
        self._scene = pulled.scene
        if pulled.stopped is not None:
            raise pulled.stopped
        return m.ActOutcome(
            action_id=request.action_id,
            grasped=pulled.grasped,
            arm_reached=planned is not None or self._follows(request),
            seconds=time.perf_counter() - start,
            detail=_said(planned, grasp),
        )

    def _follows(self, request: m.ActRequest) -> bool:
        """Whether the arm could have followed the flying picker."""
        return bool(self._reach_map.reachable(pull(request.pick, request.place)).all())

    def _stand(self, planned: ArmMotion, pulled: Pulled) -> None:
        """Leave the arm where its motion ended, or was stopped."""
        last = len(planned.joints) - 1 if pulled.stopped is None else pulled.walked - 1
        self._world.arm.move_to(planned.joints[last], planned.openings[last])

    def _tell_scene(self) -> None:
        self._tell(endpoints.DEPTH, self.capture(m.Empty(), Call()))
        self._tell(endpoints.CELL, self.status(m.Empty(), Call()))


def _said(planned: ArmMotion | None, grasp: Grasp) -> str:
    """What an outcome has to add."""
    words = [] if grasp == "good" else [f"grasp: {grasp}"]
    if planned is not None:
        words.append(f"arm: {planned.seconds:.2f} s, pull stretched {planned.stretch:.2f} times")
    return "; ".join(words)
