"""A cell small enough for a test: the door's counterparts on an in-process bus, with a table of their own."""

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import NoReturn

import httpx
import numpy as np
import pytest
import uvicorn

from medor_cloth.camera import overhead
from medor_gateway.app import create_app
from medor_gateway.config import Config
from medor_wire import endpoints, errors
from medor_wire import messages as m
from medor_wire.bus import Call
from medor_wire.local_bus import LocalBus

WIDTH = 24


def sheet(size: float, height: float = 0.002) -> m.ClothMesh:
    """A square of cloth of this size [m], two triangles, one corner hidden."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32) * (size / 2)
    return m.ClothMesh(
        vertices=corners + np.array([0, 0, height], np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        category="tshirt",
        visible=np.array([True, True, True, False]),
    )


class SmallCell:
    """Robot, simulator and planner around one square cloth that every executed pick makes 4 cm wider."""

    FLAT_M = 0.4

    def __init__(self) -> None:
        self.size_m = 0.2
        self.stopped = False
        self.acts = 0
        self.plans: dict[str, m.Plan] = {}
        self.outcomes: dict[str, m.ActOutcome] = {}
        self.go = threading.Event()
        """Planning waits for it."""
        self.go.set()
        self.failure: errors.MedorError | None = None
        """What planning ends with instead of a plan."""
        self.asked: list[m.PlanRequest] = []

    def capture(self, _: m.Empty, call: Call) -> m.DepthView:
        camera = overhead(WIDTH)
        x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(WIDTH) + 0.5)
        cloth = np.maximum(abs(x - WIDTH / 2), abs(y - WIDTH / 2)) < camera.K[0, 0] * self.size_m / 2 / 0.65
        info = m.CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=WIDTH, height=WIDTH)
        depth = np.where(cloth, 0.648 - 0.0004 * x, 0.0).astype(np.float32)
        return m.DepthView(depth=depth, camera=info, mask=cloth, stamp_ns=1_800_000_000_123_456_789)

    def status(self, _: m.Empty, call: Call) -> m.CellStatus:
        return m.CellStatus(cell="sim", state="stopped" if self.stopped else "idle", actions=self.acts)

    def clear_stop(self, order: m.ClearStop, call: Call) -> m.CellStatus:
        self.stopped = False
        return self.status(m.Empty(), call)

    def stop(self, order: m.EmergencyStop) -> None:
        self.stopped = True

    def reset(self, request: m.ResetRequest, call: Call) -> m.Score:
        if request.garment_id not in (None, "mine"):
            raise errors.NotFound(f"no garment {request.garment_id}")
        self.size_m = self.FLAT_M if request.state == "flat" else 0.2
        return self.score()

    def score(self) -> m.Score:
        ni = (self.size_m**2 - 0.04) / (self.FLAT_M**2 - 0.04)
        return m.Score(
            coverage_m2=self.size_m**2,
            flat_coverage_m2=self.FLAT_M**2,
            ni_flatten=ni,
            ni_canonicalize=ni,
            canonical_cost_m=self.FLAT_M - self.size_m,
            picks=self.acts,
        )

    def upload(self, garment: m.UploadGarment, call: Call) -> m.GarmentId:
        if garment.file_type == "obj" and b"v " not in garment.content:
            raise errors.BadRequest("expected a mesh, got no vertices")
        return m.GarmentId(garment_id="mine", vertices=4, faces=2)

    def plan(self, request: m.PlanRequest, call: Call) -> m.Plan:
        call.progress(m.PlanProgress(stage="rollout", fraction=0.5))
        return self.choose(request, call)

    def choose(self, request: m.PlanRequest, call: Call) -> m.Plan:
        self.asked.append(request)
        while not self.go.wait(0.01):
            call.check()
        if self.failure:
            raise self.failure
        mesh, best = sheet(self.size_m), min(20, request.candidates)
        picks = mesh.vertices[np.arange(best) % 4] + np.array([0, 0, 0.01], np.float32)
        plan = m.Plan(
            plan_id=f"plan-{len(self.plans)}",
            category=request.category,
            task=request.task,
            method=request.method,
            no_op=self.size_m >= self.FLAT_M,
            pick=picks[0],
            place=picks[0] * 1.2,
            reward=(self.size_m + 0.04) ** 2,
            no_op_reward=self.size_m**2,
            mesh=mesh,
            top_picks=picks,
            top_places=(picks * 1.2).astype(np.float32),
            top_rewards=np.linspace(self.size_m, 0, best),
            candidates=request.candidates,
            timings_ms={"rollout": 1.5},
        )
        self.plans[plan.plan_id] = plan
        return plan

    def execute(self, request: m.ExecuteRequest, call: Call) -> m.ActOutcome:
        if request.plan_id in self.outcomes:
            return self.outcomes[request.plan_id].model_copy(update={"replayed": True})
        if request.plan_id not in self.plans:
            raise errors.NotFound(f"no plan {request.plan_id}")
        if self.stopped:
            raise errors.EmergencyStopped("the e-stop is latched")
        self.acts += 1
        self.size_m = min(self.size_m + 0.04, self.FLAT_M)
        self.outcomes[request.plan_id] = m.ActOutcome(action_id=request.plan_id, grasped=True)
        return self.outcomes[request.plan_id]

    def episode(self, request: m.EpisodeRequest, call: Call) -> m.Episode:
        self.reset(request.reset or m.ResetRequest(), call)
        score = self.score()
        steps = [m.EpisodePick(index=0, coverage_m2=score.coverage_m2, ni=score.ni_flatten)]
        call.progress(m.EpisodeProgress(step=steps[0]))
        while len(steps) <= request.max_picks and self.score().ni_flatten < request.stop_ni:
            view = self.capture(m.Empty(), call)
            plan = self.choose(m.PlanRequest(category=request.category, seed=request.seed), call)
            call.progress(m.EpisodeProgress(planning=m.PlanProgress(stage="rollout", fraction=1.0)))
            self.execute(m.ExecuteRequest(plan_id=plan.plan_id), call)
            score = self.score()
            step = m.EpisodePick(
                index=len(steps),
                pick=plan.pick,
                place=plan.place,
                coverage_m2=score.coverage_m2,
                ni=score.ni_flatten,
                timings_ms=plan.timings_ms,
            )
            steps.append(step)
            call.progress(m.EpisodeProgress(step=step.model_copy(update={"view": view, "plan": plan})))
        reason = "solved" if score.ni_flatten >= request.stop_ni else "max_picks"
        return m.Episode(ni=score.ni_flatten, picks=tuple(steps), flat_coverage_m2=self.FLAT_M**2, reason=reason)


def unused(request: m.Message, call: Call) -> NoReturn:
    raise AssertionError("the door asks neither recon nor dynamics")


class Members:
    """The processes of the small cell; each can be taken away."""

    def __init__(self, bus: LocalBus, cell: SmallCell) -> None:
        self.recon, self.dynamics, self.planner, self.sim = (
            bus.connect(name) for name in ("recon", "dynamics", "planner", "sim")
        )
        self.recon.serve(endpoints.RECONSTRUCT, unused)
        self.dynamics.serve(endpoints.ROLLOUT, unused)
        self.planner.serve(endpoints.PLAN, cell.plan, workers=8)
        self.planner.serve(endpoints.EXECUTE, cell.execute)
        self.planner.serve(endpoints.EPISODE, cell.episode, workers=8)
        self.sim.serve(endpoints.CAPTURE, cell.capture)
        self.sim.serve(endpoints.STATUS, cell.status)
        self.sim.serve(endpoints.CLEAR_STOP, cell.clear_stop)
        self.sim.serve(endpoints.RESET, cell.reset)
        self.sim.serve(endpoints.UPLOAD_GARMENT, cell.upload)
        self.sim.subscribe(endpoints.STOP, cell.stop)
        self.all = [self.recon, self.dynamics, self.planner, self.sim]
        for member in self.all:
            member.ready()

    def close(self) -> None:
        for member in self.all:
            member.close()


@pytest.fixture(scope="session")
def small_cell() -> Callable[[LocalBus], AbstractContextManager[None]]:
    """Brings a small cell to a bus, for as long as the context lasts."""

    @contextmanager
    def present(bus: LocalBus) -> Iterator[None]:
        members = Members(bus, SmallCell())
        yield
        members.close()

    return present


@pytest.fixture
def cell() -> SmallCell:
    return SmallCell()


@pytest.fixture
def bus() -> Iterator[LocalBus]:
    with LocalBus("gateway") as bus:
        yield bus


@pytest.fixture
def members(bus: LocalBus, cell: SmallCell) -> Iterator[Members]:
    members = Members(bus, cell)
    yield members
    members.close()


@contextmanager
def listening(bus: LocalBus, config: Config) -> Iterator[httpx.Client]:
    """A client of a real server on a free port of loopback."""
    server = uvicorn.Server(uvicorn.Config(create_app(bus, config), port=0, log_config=None, lifespan="on"))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        thread.join(0.005)
    port = server.servers[0].sockets[0].getsockname()[1]
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=10) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join(5)
        assert not thread.is_alive(), "the server did not leave"


@pytest.fixture
def config() -> Config:
    return Config()


@pytest.fixture
def door(bus: LocalBus, members: Members, config: Config) -> Iterator[httpx.Client]:
    with listening(bus, config) as client:
        yield client
