"""What a dynamics model learns: where the cloth is after the next steps of a recorded pull."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from medor_dynamics.evaluate import motionless_errors, rigid_errors, rollout_errors
from medor_dynamics.model import Dynamics, edge_features, injected, node_features
from medor_dynamics.preset import STEP_S
from medor_dynamics.samples import Recording, Sampler

FITTED_ON = 32
"""Batches that the normalizer is fitted to."""


class Foresight:
    """A task of `medor_learn`: the score is the error after 16 steps on garments held out [m]."""

    def __init__(self, model: Dynamics, sampler: Sampler, held_out: Sequence[Recording]) -> None:
        self.module: nn.Module = model
        self._model = model
        self._sampler = sampler
        self._held_out = held_out
        if model.preset.normalize:
            fit(model, sampler)

    def loss(self, step: int) -> Tensor:
        """Squared error of the positions after each step, in units of a typical acceleration's effect.

        For a single step that is the squared error of the acceleration, as in the paper. The node held goes where it
        goes: its acceleration is neither used nor learnt.
        """
        batch = self._sampler.draw(step).to(self._model.device)
        unit = self._model.normalizer.acceleration_scale * STEP_S**2
        motion, squares = batch.motion, []
        for grip, target in zip(batch.grips, batch.targets, strict=True):
            motion = self._model(batch.graphs, motion, grip)
            squares.append(((motion.positions - target) / unit).square().mean())
        return torch.stack(squares).mean()

    def validate(self) -> dict[str, float]:
        """Mean over held-out pulls, beside the errors of two predictions that take no learning [m]."""
        errors = rollout_errors(self._model, self._held_out)
        return {
            "score": float(errors[:, -1].mean()),
            "first_step": float(errors[:, 0].mean()),
            "no_motion": float(motionless_errors(self._held_out)[:, -1].mean()),
            "rigid": float(rigid_errors(self._held_out)[:, -1].mean()),
        }


def fit(model: Dynamics, sampler: Sampler) -> None:
    """Fits a model's normalizer to what it will be asked."""
    nodes, edges, accelerations = [], [], []
    for step in range(FITTED_ON):
        batch = sampler.draw(step)
        grip = batch.grips[0]
        moved = injected(batch.motion, grip)
        nodes.append(node_features(moved, grip))
        edges.append(edge_features(moved.positions, batch.graphs.wire(moved.positions, model.preset)))
        velocity = (batch.targets[0] - batch.motion.positions) / STEP_S
        accelerations.append((velocity - batch.motion.velocities[:, 0]) / STEP_S)
    model.normalizer.fit(torch.cat(nodes), torch.cat(edges), torch.cat(accelerations))
