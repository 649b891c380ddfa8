"""Reading feature maps between their cells is what torch does to whole maps."""

import pytest
import torch
from torch.nn import functional as F

from medor_recon.canonical.sampling import sample


def centres(rows: int, columns: int) -> torch.Tensor:
    grid = torch.meshgrid((torch.arange(rows) + 0.5) / rows, (torch.arange(columns) + 0.5) / columns, indexing="ij")
    return torch.stack(grid, -1).reshape(1, -1, 2)


@pytest.mark.parametrize("corners", [False, True])
def test_reading_at_pixel_centres_equals_resizing_by_four(corners):
    features = torch.randn(3, 5, 7, 9)
    resized = F.interpolate(features, size=(28, 36), mode="bilinear", align_corners=corners)
    read = sample(features, centres(28, 36).expand(3, -1, -1), corners)
    torch.testing.assert_close(read.reshape(3, 28, 36, 5).permute(0, 3, 1, 2), resized, atol=1e-5, rtol=1e-5)


def test_a_map_of_one_cell_is_the_same_everywhere():
    features = torch.randn(2, 4, 1, 1)
    torch.testing.assert_close(sample(features, torch.rand(2, 6, 2)), features[:, :, 0, 0][:, None].expand(2, 6, 4))


def test_gradients_are_those_of_torch():
    features = torch.randn(2, 3, 5, 6, dtype=torch.float64, requires_grad=True)
    points = torch.rand(2, 8, 2, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda x: sample(x, points), features)
    read = sample(features, points)
    grid = (points.flip(-1) * 2 - 1)[:, :, None]
    reference = F.grid_sample(features, grid, padding_mode="border", align_corners=False)[..., 0].transpose(1, 2)
    torch.testing.assert_close(read, reference)
