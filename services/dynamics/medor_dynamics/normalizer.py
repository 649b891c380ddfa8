"""Features and accelerations in units of their spread over the training data."""

from typing import Self

import torch
from torch import Tensor, nn

from medor_dynamics.network import EDGE_FEATURES, NODE_FEATURES
from medor_dynamics.preset import HISTORY

VELOCITIES = slice(0, 3 * HISTORY)
HEIGHT = 3 * HISTORY
OFFSET = slice(0, 3)
DISTANCE, STRETCH = 3, 4


class Normalizer(nn.Module):
    """Scales of a model, kept with its weights. A new one changes nothing.

    The three axes of a vector share one scale and no shift: a normalizer does not prefer a heading.
    """

    node_mean: Tensor
    node_scale: Tensor
    edge_mean: Tensor
    edge_scale: Tensor
    acceleration_scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("node_mean", torch.zeros(NODE_FEATURES))
        self.register_buffer("node_scale", torch.ones(NODE_FEATURES))
        self.register_buffer("edge_mean", torch.zeros(EDGE_FEATURES))
        self.register_buffer("edge_scale", torch.ones(EDGE_FEATURES))
        self.register_buffer("acceleration_scale", torch.ones(()))

    def fit(self, nodes: Tensor, edges: Tensor, accelerations: Tensor) -> Self:
        """Takes means and spreads from features (N, 18), (E, 7) and accelerations (N, 3) [m/s²]."""
        self.node_scale[VELOCITIES] = root_mean_square(nodes[:, VELOCITIES])
        self.node_mean[HEIGHT], self.node_scale[HEIGHT] = nodes[:, HEIGHT].mean(), nodes[:, HEIGHT].std()
        self.edge_scale[OFFSET] = root_mean_square(edges[:, OFFSET])
        self.edge_mean[DISTANCE], self.edge_scale[DISTANCE] = edges[:, DISTANCE].mean(), edges[:, DISTANCE].std()
        self.edge_scale[STRETCH] = root_mean_square(edges[:, STRETCH])
        self.acceleration_scale.copy_(root_mean_square(accelerations))
        return self

    def nodes(self, features: Tensor) -> Tensor:
        return (features - self.node_mean) / self.node_scale

    def edges(self, features: Tensor) -> Tensor:
        return (features - self.edge_mean) / self.edge_scale


def root_mean_square(values: Tensor) -> Tensor:
    return values.square().mean().sqrt().clamp(min=1e-6)
