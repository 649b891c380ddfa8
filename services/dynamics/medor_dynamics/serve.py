"""Dynamics service: a cloth mesh and candidate actions in, rollouts and rewards out; canonical meshes laid flat.

Stateless: any number of replicas share the candidates of one plan.
"""

import os
from pathlib import Path
from typing import Literal

import torch
from pydantic import Field

from medor_cloth.picker import GLANCE_FRAMES
from medor_cloth.solver import SolverConfig
from medor_dynamics.coarse import Coarse
from medor_dynamics.flatten import Flattener
from medor_dynamics.learned import learned
from medor_dynamics.physics import Physics, without_layers
from medor_dynamics.roller import Roller
from medor_dynamics.shipped import DEFAULT
from medor_dynamics.warm_up import warm_up
from medor_learn.precision import has_bf16
from medor_wire import endpoints
from medor_wire.bus import join
from medor_wire.config import Settings

BF16, FP32 = torch.bfloat16, torch.float32
PRECISIONS = {"auto": BF16 if has_bf16() else FP32, "bfloat16": BF16, "float32": FP32}


class Config(Settings, section="dynamics"):
    threads: int = 0
    """Threads of one rollout request; 0: this replica's share of all processors."""
    replicas: int = 1
    """Replicas on this machine, which share its processors."""
    softness: float = Field(default=1.0, gt=0)
    """How many times as easily as usual the cloth of all backends but `learned` bends."""
    weights: Path = DEFAULT
    """Folder of the learned model, as training leaves it in `best`."""
    precision: Literal["auto", "bfloat16", "float32"] = "auto"
    """Of the learned model's hidden values; `auto`: bfloat16 where the processor is fast at it."""


def main(config: Config) -> None:
    threads = config.threads or -(-(os.cpu_count() or 1) // config.replicas)
    torch.set_num_threads(1)
    precision = PRECISIONS[config.precision]
    cloth = SolverConfig().softer(config.softness)
    roller = Roller(
        {
            "physics": Physics(threads, config=cloth),
            "layerless": Physics(threads, config=without_layers(cloth), settle_frames=GLANCE_FRAMES),
            "learned": learned(config.weights, threads, precision),
            "coarse": Coarse(threads, config=cloth),
        }
    )
    with join("dynamics", config.bus) as bus:
        bus.ready(False, "compiling")
        bus.serve(endpoints.ROLLOUT, roller.roll_out)
        bus.serve(endpoints.FLATTEN, Flattener().flatten)
        warm_up(roller)
        bus.ready()
        bus.run()


if __name__ == "__main__":
    main(Config.from_command_line())
