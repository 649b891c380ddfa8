"""What the service runs in where nobody says."""

import torch

from medor_dynamics import dense
from medor_dynamics.serve import PRECISIONS


def test_hidden_values_are_bfloat16_only_where_layers_can_be_fused_in_it():
    assert PRECISIONS["auto"] == (torch.bfloat16 if dense.can_fuse(torch.bfloat16) else torch.float32)
