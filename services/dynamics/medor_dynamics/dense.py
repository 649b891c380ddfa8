"""Dense layers for inference on a CPU, each in one pass with the bias and ReLU that follow it.

oneDNN does that where torch was built with it and the processor has the precision; elsewhere it takes several passes.
"""

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from medor_learn.precision import has_bf16


@dataclass(frozen=True, eq=False)
class Dense:
    """A linear layer made ready.

    Attributes:
        weight: (out, in), in the precision of the hidden values.
        bias: (out,), in the same.
        fused: whether what follows the product goes through oneDNN with it.
    """

    weight: Tensor
    bias: Tensor
    fused: bool

    @classmethod
    def of(cls, layer: nn.Module, dtype: torch.dtype) -> "Dense":
        """A copy of a layer: later changes of its weights are not seen."""
        assert isinstance(layer, nn.Linear)
        weight, bias = (values.detach().to(dtype, copy=True).contiguous() for values in (layer.weight, layer.bias))
        return cls(weight, bias, can_fuse(dtype))

    def __call__(self, values: Tensor) -> Tensor:
        """(…, in) -> (…, out)."""
        return F.linear(values, self.weight, self.bias)

    def relu(self, values: Tensor) -> Tensor:
        """(E, in) -> (E, out), nothing below zero."""
        if self.fused:
            return torch.ops.mkldnn._linear_pointwise(values, self.weight, self.bias, "relu", [], "")
        return self(values).relu_()


def can_fuse(dtype: torch.dtype) -> bool:
    """Whether this torch on this processor has a layer and its ReLU in one pass."""
    if not torch.backends.mkldnn.is_available() or not hasattr(torch.ops.mkldnn, "_linear_pointwise"):
        return False
    return dtype == torch.float32 or (dtype == torch.bfloat16 and has_bf16())


class DenseMlp:
    """Dense layers, ReLU between them."""

    def __init__(self, layers: nn.Sequential, dtype: torch.dtype) -> None:
        *inner, self._last = (Dense.of(layer, dtype) for layer in layers if isinstance(layer, nn.Linear))
        self._inner = inner

    def __call__(self, values: Tensor) -> Tensor:
        for layer in self._inner:
            values = layer.relu(values)
        return self._last(values)
