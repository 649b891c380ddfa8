"""What each candidate is expected to bring: a few small networks over its features, averaged.

Learnt by `medor_planner.judge.train`; here they are plain matrices.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file

from medor_cloth.alignment import canonical_cost
from medor_planner.judge.features import features
from medor_planner.judge.relief import Relief
from medor_planner.judge.situation import Situation
from medor_wire.errors import BadRequest
from medor_wire.messages import Task

SHIPPED = Path(__file__).parent / "weights"
WEIGHTS, CONFIG = "weights.safetensors", "config.json"
FOLDER = "all"
"""Of the judge who hears all models, in the folder of weights."""
TASKS: tuple[Task, ...] = ("flatten", "canonicalize")
"""Order of the networks' outputs."""
LIMIT = 4.0
"""Features farther from their mean, in standard deviations, count as so far."""


@dataclass(frozen=True, eq=False)
class Judge:
    """Small networks that agree by their mean.

    Attributes:
        opinions: names of those it listens to.
        names: (F) features they were taught with.
        mean, scale: (F,) of the features.
        unit: (2,) of the outputs: share of the flat coverage, metres of canonical cost.
        members: by network its layers, weights (out, in) and biases (out,).
    """

    opinions: tuple[str, ...]
    names: tuple[str, ...]
    mean: NDArray[np.float32]
    scale: NDArray[np.float32]
    unit: NDArray[np.float32]
    members: tuple[tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...], ...]

    @classmethod
    def load(cls, root: Path = SHIPPED) -> Self:
        """From the folder of weights.

        Raises:
            BadRequest: there are no weights in it.
        """
        folder = root / FOLDER
        try:
            config: dict[str, Any] = json.loads((folder / CONFIG).read_text())
            arrays = {name: array.astype(np.float32) for name, array in load_file(folder / WEIGHTS).items()}
        except (OSError, ValueError, SafetensorError) as error:
            raise BadRequest(
                f"no weights of the judge in {root.name}/{FOLDER}/ ({error}); they are trained by "
                "`python -m medor_planner.judge.train --data <folder> --out <folder>`"
            ) from error
        members = tuple(
            tuple(
                (arrays[f"members.{m}.{layer}.weight"], arrays[f"members.{m}.{layer}.bias"])
                for layer in config["layers"]
            )
            for m in range(config["members"])
        )
        return cls(
            tuple(config["opinions"]),
            tuple(config["features"]),
            arrays["mean"],
            arrays["scale"],
            arrays["unit"],
            members,
        )

    def gains(self, situation: Situation) -> NDArray[np.float32]:
        """(K, 2) what to expect of the candidates, as `expected` gives it.

        Raises:
            BadRequest: taught with other features.
            KeyError: an opinion is missing.
            NoGarment: no pixel of the view shows cloth.
        """
        names, values = features(situation.heard(self.opinions))
        if names != self.names:
            raise BadRequest("the judge's weights were taught with other features; train them anew")
        return self.expected(values)

    def expected(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """(K, 2) expected gains of features (K, F): share of the flat coverage, metres of canonical cost."""
        return np.mean([self._one(member, values) for member in self.members], axis=0) * self.unit

    def _one(self, layers: tuple, values: NDArray[np.float32]) -> NDArray[np.float32]:
        hidden = np.clip((values - self.mean) / self.scale, -LIMIT, LIMIT)
        for weight, bias in layers[:-1]:
            hidden = hidden @ weight.T + bias
            hidden = hidden / (1 + np.exp(-hidden))  # SiLU
        weight, bias = layers[-1]
        return hidden @ weight.T + bias


def rewards(situation: Situation, gains: NDArray, task: Task) -> tuple[NDArray[np.float64], float]:
    """What gains (K, 2) make of a garment as it lies.

    Returns:
        (K,) rewards to expect of the candidates and that of doing nothing: coverage that is seen [m²], or minus the
        canonical cost that is believed [m].

    Raises:
        NoGarment: no pixel of the view shows cloth.
    """
    more, goals = gains[:, TASKS.index(task)].astype(np.float64), situation.goals
    if task == "flatten":
        now = Relief.of(situation.view, situation.camera).area_m2
        return now + more * goals.flat_coverage_m2, now
    now = -float(canonical_cost(situation.mesh.vertices[None], goals.goals)[0])
    return now + more, now
