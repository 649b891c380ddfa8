"""The loss takes a garment for what it looks like, however it is turned."""

import numpy as np
import pytest
import torch

from medor_cloth.garment import CATEGORIES, SYMMETRY_ORDER
from medor_recon.canonical import symmetry
from medor_recon.canonical.head import to_bins
from medor_recon.canonical.symmetry import cross_entropy, rotations, turned, turned_points


def points(views=3, pixels=40, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return 0.5 + 0.5 * (torch.rand(views, pixels, 3, generator=generator) - 0.5)


def certain(nocs, bins=64):
    """Logits of a network that is sure of some coordinates."""
    return 50 * torch.nn.functional.one_hot(to_bins(nocs, bins), bins).float()


@pytest.mark.parametrize("category", CATEGORIES)
def test_turns_are_a_group_about_the_body_axis(category):
    turns = rotations(category)
    assert len(turns) == symmetry.turns(category) >= 2
    assert len(turns) % SYMMETRY_ORDER[category] == 0
    torch.testing.assert_close(turns[0], torch.eye(3))
    torch.testing.assert_close(torch.linalg.det(turns), torch.ones(len(turns)))
    torch.testing.assert_close(turns[:, 2], torch.tensor([0.0, 0.0, 1.0]).expand(len(turns), 3), atol=1e-6, rtol=0)
    once = turns[1]
    torch.testing.assert_close(torch.linalg.matrix_power(once, len(turns)), torch.eye(3), atol=1e-5, rtol=0)


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_loss_of_a_garment_does_not_depend_on_how_it_is_turned(category):
    logits = torch.randn(3, 40, 3, 64)
    turns, nocs = rotations(category), points()
    base, _ = cross_entropy(logits, nocs, turns)
    for other in turned(nocs, turns):
        loss, _ = cross_entropy(logits, other, turns)
        torch.testing.assert_close(loss, base, atol=5e-3, rtol=0)  # a coordinate at the border of two bins may change


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_turn_that_a_view_shows_is_found_for_each_view(category):
    turns, nocs = rotations(category), points()
    seen = turned(nocs, turns)
    wanted = torch.tensor([0, len(turns) - 1, 1])
    loss, turn = cross_entropy(certain(seen[wanted, torch.arange(3)]), nocs, turns)
    assert torch.equal(turn, wanted)
    assert loss.max() < 1e-3


def test_the_plain_loss_is_torchs_and_punishes_a_turned_garment():
    logits, nocs = torch.randn(2, 30, 3, 64), points(2, 30)
    loss, _ = cross_entropy(logits, nocs, rotations("tshirt")[:1])
    reference = torch.nn.functional.cross_entropy(logits.reshape(-1, 64), to_bins(nocs, 64).reshape(-1))
    torch.testing.assert_close(loss.mean(), reference)
    turned_over = turned(nocs, rotations("tshirt"))[1]
    assert cross_entropy(certain(turned_over), nocs, rotations("tshirt")[:1])[0].min() > 10


def test_only_the_best_turn_is_learnt_from():
    nocs = points(1)
    logits = certain(turned(nocs, rotations("tshirt"))[1]).requires_grad_()
    cross_entropy(logits, nocs, rotations("tshirt"))[0].sum().backward()
    assert logits.grad is not None
    assert logits.grad.abs().max() < 1e-6


def test_a_shirt_has_two_sides_and_a_skirt_none_to_choose():
    assert {category: symmetry.sides(category) for category in CATEGORIES} == {
        "trousers": 1, "tshirt": 2, "dress": 1, "skirt": 1, "jumpsuit": 1,
    }  # fmt: skip


def test_half_a_turn_twice_is_none():
    nocs = points(1)[0].numpy()
    twice = turned_points(turned_points(nocs, "tshirt", 1), "tshirt", 1)
    np.testing.assert_allclose(twice, nocs, atol=1e-6)
    assert np.abs(turned_points(nocs, "tshirt", 1)[:, 2] - nocs[:, 2]).max() < 1e-6


def test_labels_are_not_rounded_where_the_network_is():
    nocs = points()
    with torch.autocast("cpu", torch.bfloat16):
        torch.testing.assert_close(turned(nocs, rotations("skirt"))[0], nocs, atol=1e-6, rtol=0)
