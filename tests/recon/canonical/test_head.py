"""Bins: a coordinate survives them to half a bin, without being pulled either way."""

import pytest
import torch

from medor_recon.canonical.head import Head, decode, from_bins, to_bins

COORDINATES = torch.linspace(0, 1, 10_001)


@pytest.mark.parametrize("bins", [64, 17])
def test_rounding_to_bins_is_off_by_half_a_bin_at_most_and_not_to_one_side(bins):
    error = from_bins(to_bins(COORDINATES, bins), bins) - COORDINATES
    assert error.abs().max() <= 0.5 / (bins - 1) + 1e-6
    assert abs(error.mean()) < 1e-5
    floored = torch.floor((bins - 1) * COORDINATES) / (bins - 1) - COORDINATES
    assert floored.mean() == pytest.approx(-0.5 / (bins - 1), rel=0.05)


def test_coordinates_outside_of_the_cube_belong_to_its_walls():
    assert to_bins(torch.tensor([-0.1, 1.2]), 64).tolist() == [0, 63]


def logits_around(position: float, width: float = 1.0) -> torch.Tensor:
    return (-0.5 * ((torch.arange(64) - position) / width) ** 2).expand(3, 64)


@pytest.mark.parametrize("position", [10.0, 31.3, 40.5, 52.8])
def test_the_mean_around_the_mode_is_finer_than_a_bin(position):
    mean, _ = decode(logits_around(position))
    mode, _ = decode(logits_around(position), "mode")
    assert mean[0] * 63 == pytest.approx(position, abs=0.05)
    assert mode[0] * 63 == pytest.approx(position, abs=0.5)


def test_a_far_off_second_opinion_does_not_pull():
    two = torch.logaddexp(logits_around(12.0), logits_around(50.0) - 0.5)
    mean, confidence = decode(two)
    assert mean[0] * 63 == pytest.approx(12.0, abs=0.05)
    assert 0.1 < confidence[0] < 0.5


def test_at_the_wall_of_the_cube_only_bins_that_exist_count():
    mean, confidence = decode(60 * torch.nn.functional.one_hot(torch.tensor([0, 63, 5]), 64).float())
    torch.testing.assert_close(mean, torch.tensor([0, 1, 5 / 63]), atol=1e-6, rtol=0)
    assert confidence.min() > 0.999


def test_the_head_answers_for_each_pixel_alone():
    head = Head(12, 20, bins=64).eval()
    features = torch.randn(2, 5, 12)
    whole = head(features)
    assert whole.shape == (2, 5, 3, 64)
    torch.testing.assert_close(head(features[1:, 3:4]), whole[1:, 3:4])
