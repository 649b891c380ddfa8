"""Weights that have learnt nothing: `python -m medor_dynamics.untrained --preset cpu --out DIR`.

They roll out as fast as learnt ones and foresee nothing: for measuring speed and for trying a cell out.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import torch
import tyro

from medor_dynamics.model import Dynamics
from medor_dynamics.preset import PRESETS
from medor_learn import weights


@dataclass(frozen=True)
class Options:
    """What to write."""

    out: Path
    preset: Literal["cpu", "paper"] = "cpu"
    seed: int = 0


def main(options: Options) -> None:
    torch.manual_seed(options.seed)
    preset = PRESETS[options.preset]
    weights.save(options.out, Dynamics(preset), {"preset": asdict(preset), "training": None}, {})


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
