"""In which precision networks run fast here."""

import torch


def has_bf16(device: str = "cpu") -> bool:
    """Whether bfloat16 is worth having on a kind of device.

    A processor without AVX-512 multiplies bfloat16 matrices twenty times as slowly as those of float32; most laptops
    have such a one.
    """
    return device != "cpu" or (torch.backends.mkldnn.is_available() and torch.ops.mkldnn._is_mkldnn_bf16_supported())
