"""The same exam for every cell: a bus with the cell on it and somebody who asks."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from medor_cloth.camera import overhead
from medor_cloth.raster import rasterize
from medor_robot.driver import Driver
from medor_robot.dry_run import DryRunArm
from medor_robot.replay import ReplayCamera
from medor_robot.workspace import Workspace
from medor_sim.scene import Scene
from medor_sim.simulator import Simulator
from medor_sim.wardrobe import Wardrobe
from medor_wire import endpoints
from medor_wire.bus import Call
from medor_wire.cell import Cell, serve_cell
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.local_bus import LocalBus
from medor_wire.messages import ActRequest, Executor, LeaseRequest, ResetRequest
from medor_wire.motion import Motion


@dataclass
class Exam:
    """A cell under test and who asks it."""

    ask: LocalBus
    server: LocalBus
    ledger: Ledger
    executor: Executor = "picker"

    def acquire(self, holder: str | None = None) -> int:
        request = LeaseRequest(holder=holder or self.ask.presence)
        return self.ask.ask(endpoints.LEASE, request).epoch

    def act(self, action_id: str, epoch: int, place=(0.05, 0.05, 0.1)):
        request = ActRequest(
            action_id=action_id,
            epoch=epoch,
            pick=np.array([0.0, 0.0, 0.02]),
            place=np.array(place),
            executor=self.executor,
        )
        return self.ask.ask(endpoints.ACT, request)


@pytest.fixture(scope="session")
def wardrobe() -> Wardrobe:
    return Wardrobe()


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory, wardrobe: Wardrobe) -> Path:
    """Two recorded views of a flat skirt."""
    folder = tmp_path_factory.mktemp("recording")
    camera = overhead(180)
    scene = Scene.begin(wardrobe.generated("skirt", 800001), "flat", 0)
    raster = rasterize(scene.cloth.positions, scene.piece.garment.faces, camera)
    for name in ("0001", "0002"):
        np.savez(folder / f"{name}.npz", depth=raster.depth, mask=raster.mask)
    pose = {"K": camera.K.tolist(), "T_world_camera": camera.T_world_camera.tolist()}
    (folder / "camera.json").write_text(json.dumps(pose))
    return folder


@pytest.fixture(params=["sim", "sim by the arm", "robot"])
def exam(
    request: pytest.FixtureRequest, tmp_path: Path, wardrobe: Wardrobe, recording: Path, simulator: Callable
) -> Iterator[Exam]:
    server = LocalBus("cell")
    ledger = Ledger(tmp_path / "ledger.sqlite")
    # The exam is about what a lease guards, not about renewing it in time on a busy machine.
    motion = Motion(ledger, Lessor(ledger, ttl_s=60))
    cell: Cell
    if request.param != "robot":
        cell = simulator(motion, server)
    else:
        cell = Driver(motion, DryRunArm(), ReplayCamera(recording), Workspace(), server.publish)
    serve_cell(server, cell, motion.lessor)
    asker = server.connect("planner")
    yield Exam(asker, server, ledger, "panda" if request.param == "sim by the arm" else "picker")
    asker.close()
    server.close()
    ledger.close()


@pytest.fixture
def simulator(wardrobe: Wardrobe) -> Iterator[Callable[[Motion, LocalBus], Simulator]]:
    made: list[Simulator] = []

    def make(motion: Motion, bus: LocalBus) -> Simulator:
        made.append(Simulator(motion, wardrobe, bus.publish))
        made[-1].reset(ResetRequest(category="skirt", garment_seed=800001, state="flat"), Call())
        return made[-1]

    yield make
    for simulator in made:
        simulator.close()
