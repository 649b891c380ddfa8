"""Backend `learned`: candidates rolled out by a graph network on the coarse mesh (MEDOR, sections IV-B and IV-C)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from medor_dynamics.model import Predictor
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.on_nodes import OnNodes
from medor_dynamics.rollout import Pulls, roll_out
from medor_dynamics.shipped import load
from medor_learn.errors import WeightsError
from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import RolloutRequest, Rollouts

TRAINING = "python -m medor_dynamics.train --preset cpu --data DIR --test DIR --out DIR --hours 4"


class Learned(OnNodes):
    """Rolls candidates out with a model as many chunks at a time as it is given threads."""

    def __init__(self, predictor: Predictor, threads: int, keep: int = 8) -> None:
        super().__init__(threads, keep)
        self._predictor = predictor

    def _move(
        self, nodes: NodeMesh, start: NDArray[np.float32], pulls: Pulls, call: Call, on_done: Callable[[int], None]
    ) -> NDArray[np.float32]:
        graphs = nodes.graphs(start, self._predictor.preset)
        return roll_out(self._predictor, graphs, start, pulls, threads=self._threads, check=call.check, on_done=on_done)


class Untrained:
    """Stands where a model would be: says how to get one."""

    def __init__(self, fault: str) -> None:
        self._fault = fault

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts:
        """Raises `BadRequest` always: asking again would not help."""
        raise BadRequest(f"backend {request.backend!r} has no weights ({self._fault}); train them with `{TRAINING}`")


def learned(folder: Path, threads: int, precision: torch.dtype) -> Learned | Untrained:
    """The backend of the weights in a folder, on a GPU when there is one."""
    device = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        return Learned(load(folder, device).predictor(precision), threads)
    except WeightsError as error:
        return Untrained(str(error))
