import torch

from medor_recon.completion.field import Field, FieldConfig
from medor_recon.completion.presets import PRESETS
from medor_recon.completion.unet3d import UNet3d


def parameters(module: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def by_hand(inputs: int, outputs: int, maps: int, levels: int) -> int:
    """Kernels of 27 weights, two GroupNorm vectors before each, a last convolution with bias."""
    widths = [maps * 2**level for level in range(levels)]
    convolutions = []
    for before, width in zip([inputs, *widths], widths, strict=False):
        middle = max(width // 2, before)
        convolutions += [(before, middle), (middle, width)]
    for coarse, fine in zip(widths[1:], widths, strict=False):
        convolutions += [(coarse + fine, fine), (fine, fine)]
    return sum(27 * a * b + 2 * a for a, b in convolutions) + maps * outputs + outputs


def test_parameters_of_the_published_network():
    assert parameters(UNet3d(128, 128, 32, 4)) == by_hand(128, 128, 32, 4) == 4_624_640


def test_shape_is_kept_at_every_size():
    for grid, levels in ((8, 3), (16, 4)):
        assert UNet3d(5, 7, 8, levels)(torch.rand(2, 5, grid, grid, grid)).shape == (2, 7, grid, grid, grid)


def test_a_corner_is_felt_everywhere():
    torch.manual_seed(0)
    net = UNet3d(1, 1, 8, 3).eval()
    volume = torch.zeros(1, 1, 8, 8, 8)
    touched = volume.clone()
    touched[0, 0, 0, 0, 0] = 1
    felt = net(touched) != net(volume)
    assert felt.float().mean() > 0.9
    assert felt[0, 0, -1, -1].any()


def test_published_sizes():
    field = Field(FieldConfig(), ("tshirt",))
    first = next(field.aggregate.parameters())
    assert first.shape == (489, 489)
    assert parameters(field.aggregate) == 489 * 489 + 489 + 2 * 489 + 489 * 128 + 128 + 2 * 128
    assert parameters(field.to_winding) == 128 * 256 + 256 * 256 + 256 + 6 * 256 + 1
    garmentnets = PRESETS["garmentnets"].network
    assert isinstance(garmentnets, FieldConfig)
    aggregate = Field(garmentnets, ("skirt",)).aggregate
    assert parameters(aggregate) == 137 * 137 + 3 * 137 + 137 * 128 + 3 * 128
