"""Simulated cell: serves the robot's endpoints and, beside them, what only a simulation can know or do."""

from contextlib import closing
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from medor_cloth.camera import overhead
from medor_cloth.solver import SolverConfig
from medor_sim.grasp_failures import GraspFailures
from medor_sim.scene import Scene
from medor_sim.simulator import Simulator
from medor_sim.wardrobe import Wardrobe
from medor_wire import endpoints
from medor_wire.bus import Bus, join
from medor_wire.cell import serve_cell
from medor_wire.config import Settings
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.motion import Motion


class Config(Settings, section="sim"):
    engine: Literal["xpbd", "bullet"] = "xpbd"
    """What moves the cloth: our solver, or PyBullet's soft body (slow; see the README)."""
    softness: float = Field(default=1.0, gt=0)
    """How many times as easily as usual the cloth bends; `xpbd` only."""
    ledger: Path = Path("runs/sim/ledger.sqlite")
    """Where actions are written down before they are carried out."""
    miss: float = Field(default=0.0, ge=0, le=1)
    """Probability that a grasp catches nothing."""
    two_layers: float = Field(default=0.0, ge=0, le=1)
    """Probability that a grasp catches the next layer too, where there is one."""
    failure_seed: int = Field(default=0, ge=0)
    """Of the chance with which grasps fail."""
    garments: int = 8
    """Garments kept with their flat state and goals; as many uploaded ones."""


def serve(bus: Bus, simulator: Simulator, motion: Motion) -> None:
    serve_cell(bus, simulator, motion.lessor)
    bus.serve(endpoints.RESET, simulator.reset)
    bus.serve(endpoints.SCORE, simulator.score)
    bus.serve(endpoints.TRUTH, simulator.truth)
    bus.serve(endpoints.UPLOAD_GARMENT, simulator.upload_garment)


def warm_up() -> None:
    """Compile what resets, actions and views need, on a garment that never comes onto the table."""
    scene = Scene.begin(Wardrobe(1).generated("tshirt", 0), "flat", 0)
    after = scene.pulled(scene.cloth.positions[0], np.array([0.0, 0.0, 0.1]), lambda: None).scene
    after.score()
    after.truth(overhead())


def main(config: Config) -> None:
    ledger = Ledger(config.ledger)
    motion = Motion(ledger, Lessor(ledger))
    failures = GraspFailures(config.miss, config.two_layers, config.failure_seed)
    with join("sim", config.bus) as bus:
        bus.ready(False, "warming up")
        wardrobe = Wardrobe(config.garments, config.engine, SolverConfig().softer(config.softness))
        with closing(Simulator(motion, wardrobe, bus.publish, failures)) as simulator:
            serve(bus, simulator, motion)
            warm_up()
            bus.ready()
            bus.run()
    ledger.close()


if __name__ == "__main__":
    main(Config.from_command_line())
