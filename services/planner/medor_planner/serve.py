"""Planner service: task and view in, the best pick-and-place out; plans executed once; closed-loop episodes.

Plans run beside each other; actions and episodes one at a time, since there is one robot.
"""

from pathlib import Path

from pydantic import Field

from medor_planner.episode import Episodes
from medor_planner.executor import Executor
from medor_planner.judge.judge import SHIPPED
from medor_planner.planner import GLANCES, Planner
from medor_planner.plans import Plans
from medor_planner.screening import BACKEND, KEEP, Screening
from medor_planner.shooting import CHUNK
from medor_wire import endpoints
from medor_wire.bus import join
from medor_wire.config import Settings


class Config(Settings, section="planner"):
    keep_plans: int = 64
    """Plans that can still be executed; older ones are forgotten."""
    chunk: int = CHUNK
    """Candidates per request to a dynamics instance."""
    plans_at_once: int = 2
    screen: str = BACKEND
    """Dynamics backend that chooses the candidates that are rolled out; empty: none, all are."""
    keep: float = Field(default=KEEP, gt=0, le=1)
    """Share of the candidates that screening leaves."""
    glances: int = Field(default=GLANCES, ge=1)
    """Pulls that a judge glances at for every candidate that is asked for."""
    judge: Path = SHIPPED
    """Folder of the weights of the glance and of the judge."""


def main(config: Config) -> None:
    with join("planner", config.bus) as bus:
        plans = Plans(config.keep_plans)
        planner = Planner(
            bus,
            plans,
            config.chunk,
            Screening(config.screen, config.keep),
            config.judge,
            config.glances,
        )
        executor = Executor(bus, plans)
        bus.serve(endpoints.PLAN, planner.plan, workers=config.plans_at_once)
        bus.serve(endpoints.EXECUTE, executor.execute)
        bus.serve(endpoints.EPISODE, Episodes(bus, planner, executor).run, queue=0)
        bus.run()


if __name__ == "__main__":
    main(Config.from_command_line())
