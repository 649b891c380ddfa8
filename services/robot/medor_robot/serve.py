"""Real cell: serves the robot's endpoints. So far its arm rehearses (nothing moves), its camera replays recordings."""

from pathlib import Path
from typing import Literal

from medor_robot.driver import Driver
from medor_robot.dry_run import DryRunArm
from medor_robot.replay import ReplayCamera
from medor_robot.workspace import Workspace
from medor_wire.bus import join
from medor_wire.cell import serve_cell
from medor_wire.config import Settings
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.motion import Motion


class Config(Settings, section="robot"):
    arm: Literal["dry-run"] = "dry-run"
    """Which arm: `dry-run` checks every limit, logs the waypoints and moves nothing."""
    camera: Literal["replay"] = "replay"
    """Which camera: `replay` plays the views of `recording`."""
    recording: Path = Path("runs/robot/recording")
    """Folder of recorded views with their camera.json."""
    ledger: Path = Path("runs/robot/ledger.sqlite")
    """Where actions are written down before they are carried out."""
    half_side: float = Workspace.half_side
    """Half side of the square on the table the tool may enter [m]."""
    highest: float = Workspace.highest
    """The tool goes no higher [m]."""
    lowest: float = Workspace.lowest
    """The tool goes no lower [m]."""
    top_speed: float = Workspace.top_speed
    """Of the tool [m/s]."""


def main(config: Config) -> None:
    workspace = Workspace(config.half_side, config.highest, config.lowest, config.top_speed)
    ledger = Ledger(config.ledger)
    motion = Motion(ledger, Lessor(ledger))
    with join("robot", config.bus) as bus:
        driver = Driver(motion, DryRunArm(), ReplayCamera(config.recording), workspace, bus.publish)
        serve_cell(bus, driver, motion.lessor)
        bus.run()
    ledger.close()


if __name__ == "__main__":
    main(Config.from_command_line())
