"""Sheets of cloth under the overhead camera, and a whole cell on one in-process bus, with a solver for a robot."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from medor_cloth.alignment import canonical_cost
from medor_cloth.camera import Camera, overhead
from medor_cloth.coverage import coverage
from medor_cloth.garment import Garment, generate
from medor_cloth.goals import flattened, goal_set, solver_of
from medor_cloth.picker import GLANCE_FRAMES, pick_place
from medor_cloth.raster import rasterize, visible_vertices
from medor_cloth.solver import ClothState, SolverConfig
from medor_dynamics.coarse import Coarse
from medor_dynamics.flatten import Flattener
from medor_dynamics.learned import learned
from medor_dynamics.physics import Physics, without_layers
from medor_dynamics.roller import Backend, Roller
from medor_dynamics.serve import PRECISIONS
from medor_dynamics.shipped import DEFAULT
from medor_dynamics.warm_up import warm_up
from medor_planner.episode import Episodes
from medor_planner.executor import Executor
from medor_planner.judge.opinions import OPINIONS
from medor_planner.judge.situation import Foreseen, Situation
from medor_planner.planner import Planner
from medor_planner.plans import Plans
from medor_planner.sampling import Scene, anywhere, sample
from medor_recon.reconstructor import Reconstructor
from medor_wire import endpoints
from medor_wire.bus import Call
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.local_bus import LocalBus
from medor_wire.messages import (
    ActOutcome,
    ActRequest,
    CameraInfo,
    ClothMesh,
    DepthView,
    Empty,
    GoalSet,
    Lease,
    LeaseRequest,
    Reach,
    ReachRequest,
    ResetRequest,
    Score,
    Truth,
)
from medor_wire.motion import Check, Motion
from tests.planner.decisions import COUNT


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    """Kernels compile under the interpreter lock, for longer than a lease lives: do that before there is one."""
    warm_up(Roller({"physics": Physics(threads=1)}))


@pytest.fixture
def camera() -> Camera:
    return overhead(240)


@pytest.fixture
def sheet_scene(camera: Camera) -> Callable[..., Scene]:
    def make(*, folded: bool = False, centre: tuple[float, float] = (0.0, 0.0)) -> Scene:
        vertices, faces = sheet(0.2, 0.24)
        if folded:
            over = vertices[:, 0] > 0.034
            vertices[over] = vertices[over] * [-1, 1, 1] + [0.068, 0, 0.006]
        vertices = (vertices + [*centre, 0]).astype(np.float32)
        mesh = ClothMesh(
            vertices=vertices, faces=faces, category="tshirt", visible=visible_vertices(vertices, faces, camera)
        )
        return Scene(mesh, view_of(vertices, faces, camera))

    return make


@pytest.fixture
def situation(sheet_scene: Callable[..., Scene]) -> Situation:
    """A sheet with one side folded over. The models foresee that all of it goes with the pull, more or less."""
    scene = sheet_scene(folded=True)
    flat = sheet_scene().mesh.vertices
    rng = np.random.default_rng(0)
    uneven = rng.normal(0, 5e-4, flat.shape).astype(np.float32)  # no two vertices just as far apart as a threshold
    mesh = scene.mesh.model_copy(
        update={
            "vertices": scene.mesh.vertices + uneven,
            "canonical": flat,
            "confidence": np.linspace(0, 1, len(flat), dtype="f4"),
        }
    )
    candidates = sample(scene, COUNT, rng, reachable=lambda picks, places: anywhere(picks))
    pulls = np.concatenate([np.zeros((1, 3)), candidates.places - candidates.picks]).astype(np.float32)
    share = np.linspace(0, 1, len(flat), dtype=np.float32)[:, None]
    foreseen = {
        opinion.name: Foreseen(mesh, (mesh.vertices + part * share * pulls[:, None]).astype(np.float32))
        for opinion, part in zip(OPINIONS, (1.0, 0.5, 0.2, 0.8), strict=True)
    }
    return Situation(scene.view, mesh, candidates, GoalSet(goals=flat[None], flat_coverage_m2=0.048), foreseen)


def sheet(width: float, length: float, edge: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """A rectangle of triangles lying 5 mm over the table, centred on the origin."""
    nx, ny = round(width / edge) + 1, round(length / edge) + 1
    x, y = np.meshgrid(np.linspace(-width / 2, width / 2, nx), np.linspace(-length / 2, length / 2, ny), indexing="ij")
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    a, b, c, d = corner, corner + ny, corner + ny + 1, corner + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    return np.stack([x, y, np.full_like(x, 0.005)], -1).reshape(-1, 3), faces


def view_of(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> DepthView:
    info = CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=camera.width, height=camera.height)
    return DepthView(depth=rasterize(vertices, faces, camera).depth, camera=info)


@dataclass
class Cell:
    """A robot cell without a robot: the solver moves the garment, everything is in reach."""

    garment: Garment
    camera: Camera
    state: ClothState = field(init=False)
    ledger: Ledger
    acts: list[str] = field(default_factory=list)
    """Ids of the actions that moved something."""
    executors: list[str] = field(default_factory=list)
    """Who was to carry them out."""
    asked_reach_of: list[str] = field(default_factory=list)
    leases: list[str] = field(default_factory=list)
    in_reach: Callable[[np.ndarray], np.ndarray] = field(default=lambda points: np.ones(len(points), bool))

    def __post_init__(self) -> None:
        self.lessor = Lessor(self.ledger)
        self.motion = Motion(self.ledger, self.lessor)
        self.solver = solver_of(self.garment)
        self.flat = flattened(self.garment, self.solver)
        self.goals = goal_set(self.garment, self.solver)
        self.lay(self.flat)

    @property
    def positions(self) -> np.ndarray:
        return self.state.positions

    def lay(self, state: ClothState) -> None:
        """Start anew from `state`."""
        self.state = self.solver.rest(state.positions)
        self.start = self._measure()

    def fold_corner(self) -> None:
        """Fold a sleeve or a leg over: a garment that one pull can improve."""
        outermost = self.flat.positions[self.flat.positions[:, :2].sum(axis=1).argmin()]
        pick = outermost + np.array([0, 0, 0.01], np.float32)
        middle = np.array([0.02, 0.02, 0.06], np.float32)
        self.lay(pick_place(self.solver, self.flat, pick, middle).state)

    def capture(self, _: Empty, call: Call) -> DepthView:
        return view_of(self.positions, self.garment.faces, self.camera)

    def reach(self, request: ReachRequest, call: Call) -> Reach:
        self.asked_reach_of.append(request.executor)
        ends = [request.points] if request.places is None else [request.points, request.places]
        return Reach(reachable=np.all([self.in_reach(end) for end in ends], axis=0))

    def lease(self, request: LeaseRequest, call: Call) -> Lease:
        self.leases.append(request.action)
        return self.lessor.lease(request, call)

    def act(self, request: ActRequest, call: Call) -> ActOutcome:
        return self.motion.act(request, call, allow=lambda _: None, move=self._move)

    def _move(self, request: ActRequest, check: Check) -> ActOutcome:
        self.acts.append(request.action_id)
        self.executors.append(request.executor)
        outcome = pick_place(self.solver, self.state, request.pick, request.place)
        self.state = self.solver.rest(outcome.state.positions)
        return ActOutcome(action_id=request.action_id, grasped=outcome.grasped)

    def reset(self, request: ResetRequest, call: Call) -> Score:
        self.lay(self.flat)
        self.fold_corner()
        return self.score(Empty(), call)

    def score(self, _: Empty, call: Call) -> Score:
        covered, cost = self._measure()
        covered_start, cost_start = self.start
        flat = coverage(self.flat.positions, self.garment.faces)
        return Score(
            coverage_m2=covered,
            flat_coverage_m2=flat,
            ni_flatten=(covered - covered_start) / max(flat - covered_start, 1e-9),
            ni_canonicalize=1 - cost / max(cost_start, 1e-9),
            canonical_cost_m=cost,
            picks=len(self.acts),
        )

    def truth(self, _: Empty, call: Call) -> Truth:
        mesh = ClothMesh(
            vertices=self.positions,
            faces=self.garment.faces,
            category="tshirt",
            visible=visible_vertices(self.positions, self.garment.faces, self.camera),
            canonical=self.garment.vertices,
            panel_uv=self.garment.panel_uv,
        )
        return Truth(mesh=mesh, garment_id="test")

    def serve(self, bus: LocalBus, *, referee: bool = True) -> None:
        bus.serve(endpoints.CAPTURE, self.capture)
        bus.serve(endpoints.REACH, self.reach)
        bus.serve(endpoints.LEASE, self.lease)
        bus.serve(endpoints.ACT, self.act)
        bus.on_presence(self.lessor.gone)
        if referee:
            bus.serve(endpoints.RESET, self.reset)
            bus.serve(endpoints.SCORE, self.score)
            bus.serve(endpoints.TRUTH, self.truth)

    def _measure(self) -> tuple[float, float]:
        return coverage(self.positions, self.garment.faces), float(canonical_cost(self.positions, self.goals))


@pytest.fixture(scope="session")
def tshirt() -> Garment:
    return generate("tshirt", 800_001, edge_m=0.025)


@pytest.fixture
def cell(tshirt: Garment, camera: Camera, tmp_path: Path) -> Iterator[Cell]:
    cell = Cell(tshirt, camera, Ledger(tmp_path / "ledger.sqlite"))
    cell.fold_corner()
    yield cell
    cell.ledger.close()


class Lab:
    """Every service on one in-process bus."""

    def __init__(self, cell: Cell, *, referee: bool = True, **backends: Backend) -> None:
        self.cell = cell
        self.backends = {"physics": Physics(threads=1), **backends}
        self.bus = LocalBus("asker")
        self.members: dict[str, LocalBus] = {}
        cell.serve(self.join("robot-1"), referee=referee)
        self.join("recon-1").serve(endpoints.RECONSTRUCT, Reconstructor().reconstruct)
        self.add_dynamics("dynamics-1")
        bus = self.join("planner-1")
        plans = Plans(4)
        planner = Planner(bus, plans, chunk=4)
        executor = Executor(bus, plans)
        bus.serve(endpoints.PLAN, planner.plan)
        bus.serve(endpoints.EXECUTE, executor.execute)
        bus.serve(endpoints.EPISODE, Episodes(bus, planner, executor).run, queue=0)

    def join(self, id: str) -> LocalBus:
        self.members[id] = self.bus.connect(id)
        return self.members[id]

    def add_dynamics(self, id: str) -> None:
        member = self.join(id)
        member.serve(endpoints.ROLLOUT, Roller(self.backends).roll_out)
        member.serve(endpoints.FLATTEN, Flattener().flatten)

    def close(self) -> None:
        closing = [threading.Thread(target=member.close) for member in (self.bus, *self.members.values())]
        for thread in closing:
            thread.start()
        for thread in closing:
            thread.join()


@pytest.fixture
def lab(cell: Cell) -> Iterator[Lab]:
    lab = Lab(cell)
    yield lab
    lab.close()


@pytest.fixture
def full_lab(cell: Cell) -> Iterator[Lab]:
    """With every dynamics backend."""
    lab = Lab(
        cell,
        layerless=Physics(threads=1, config=without_layers(SolverConfig()), settle_frames=GLANCE_FRAMES),
        coarse=Coarse(threads=1),
        learned=learned(DEFAULT, 1, PRECISIONS["auto"]),
    )
    yield lab
    lab.close()


@pytest.fixture
def real_lab(cell: Cell) -> Iterator[Lab]:
    """Without a referee, like a cell that is not simulated."""
    lab = Lab(cell, referee=False)
    yield lab
    lab.close()
