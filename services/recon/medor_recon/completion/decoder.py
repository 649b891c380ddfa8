"""Implicit decoder: a small network read at single points (MEDOR, section III-B)."""

from torch import Tensor, nn


class Decoder(nn.Module):
    """(…, inputs) → (…, outputs): linear layers and ReLU, a linear output.

    The released code ends in batch norm, for the winding number after a ReLU. Statistics of a batch have no place in an
    output with a unit.

    Args:
        batch_norm: after each hidden layer.
    """

    def __init__(self, inputs: int, hidden: tuple[int, ...], outputs: int, batch_norm: bool = False) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for width in hidden:
            layers += [nn.Linear(inputs, width), nn.ReLU()]
            if batch_norm:
                layers.append(nn.BatchNorm1d(width))
            inputs = width
        self.layers = nn.Sequential(*layers, nn.Linear(inputs, outputs))

    def forward(self, points: Tensor) -> Tensor:
        return self.layers(points.flatten(0, -2)).unflatten(0, points.shape[:-1])
