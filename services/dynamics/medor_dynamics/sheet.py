"""A picture of recorded pulls and what backends foresaw of them."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from medor_cloth.dataset import Trajectory
from medor_cloth.footage import Footage
from medor_cloth.view import pictures
from medor_dynamics.replay import request_of
from medor_dynamics.roller import Backend
from medor_wire.bus import Call

WIDTH_PX = 240


def sheet(trajectories: Sequence[Trajectory], backends: Mapping[str, Backend]) -> NDArray[np.uint8]:
    """(H, W, 3) RGB: a row for each pull, from above: before it, as recorded after it, as each backend foresees it."""
    return np.concatenate([row(each, backends) for each in trajectories])


def row(trajectory: Trajectory, backends: Mapping[str, Backend]) -> NDArray[np.uint8]:
    asked, recorded = request_of(trajectory), trajectory["positions"]
    states = {"before": recorded[0], "recorded": recorded[-1]}
    states |= {name: backend.roll_out(asked, Call()).positions[0] for name, backend in backends.items()}
    shots = [
        pictures(Footage(f"{asked.mesh.category}: {name}", state[None], asked.mesh.faces), "top", WIDTH_PX)[0]
        for name, state in states.items()
    ]
    return np.concatenate(shots, axis=1)
