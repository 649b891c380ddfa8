"""Batches: whatever is done to a view, depth, labels and world points go on telling the same story."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_cloth.errors import DatasetError
from medor_recon.canonical import augment
from medor_recon.canonical.augment import Augmentation, measured
from medor_recon.canonical.batches import draw
from medor_recon.canonical.preset import CPU, GARMENTNETS, PAPER
from medor_recon.canonical.views import Views
from tests.recon.canonical.sheets import CAMERA, label

CROP = replace(CPU, size=96, pixels=200)
WHOLE = replace(CPU, view="whole", size=200, pixels=200)
TURNED = Augmentation(180, 0.5, 8, 0, 0, 0, 0)
ROWS = np.arange(5)
PIXEL_M = 0.0027


@pytest.fixture(scope="module")
def views(write_data):
    return Views.read([write_data()], ["tshirt"], "train")


def turned_back(points, angle):
    cos, sin = np.cos(angle), np.sin(angle)
    return points @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])


def angle_of(points, nocs) -> float:
    """By how much the points (N, 3) are turned from where their labels (N, 3) have them."""
    return float(np.angle(np.vdot((nocs[:, :2] - 0.5) @ (1, 1j), points[:, :2] @ (1, 1j))))


@pytest.mark.parametrize("preset", [CROP, WHOLE, replace(WHOLE, size=128)])
def test_labels_and_world_points_turn_together(views, preset):
    """Labels are a function of the point before turning: x and y (about the middle) and height."""
    batch = draw(views, ROWS, preset, replace(TURNED, mirrored=0), np.random.default_rng(1))
    for points, nocs in zip(batch.points, batch.nocs.numpy(), strict=True):
        upright = turned_back(points, angle_of(points, nocs))
        assert np.abs(label(upright) - nocs)[:, :2].max() < 1.2 * PIXEL_M
        np.testing.assert_allclose(nocs[:, 2], label(points)[:, 2], atol=4e-4)


def test_turns_are_of_every_angle(views):
    angles = []
    for seed in range(8):
        batch = draw(views, ROWS, WHOLE, replace(TURNED, mirrored=0), np.random.default_rng(seed))
        angles += [angle_of(*pair) for pair in zip(batch.points, batch.nocs.numpy(), strict=True)]
    quarters = np.histogram(angles, 4, (-np.pi, np.pi))[0]
    assert quarters.min() >= 3


def test_a_mirrored_garment_is_labelled_as_the_mirrored_garment_it_is(views):
    """Mirroring the world and the garment leaves the function from one to the other as it was: x to −x in both."""
    batch = draw(views, ROWS, WHOLE, replace(augment.NONE, mirrored=1), np.random.default_rng(0))
    for points, nocs in zip(batch.points, batch.nocs.numpy(), strict=True):
        assert np.abs(label(points) - nocs)[:, :2].max() < 1.2 * PIXEL_M
    plain = draw(views, ROWS, WHOLE, augment.NONE, np.random.default_rng(0))
    torch.testing.assert_close(batch.seen[0], plain.seen[0].flip(-1))


@pytest.mark.parametrize("preset", [CROP, WHOLE])
def test_the_image_shows_the_heights_of_the_points_at_the_pixels(views, preset):
    batch = draw(views, ROWS, preset, TURNED, np.random.default_rng(2))
    image, shares = batch.seen
    rows, columns = (shares.numpy() * preset.size).astype(int).transpose(2, 0, 1)
    view = np.arange(5)[:, None]
    np.testing.assert_allclose(image[view, 0, rows, columns] / 20, batch.points[..., 2], atol=1e-5)
    assert image[view, 1, rows, columns].min() == 1
    assert 0.05 < image[:, 1].mean() < 0.9


def test_the_points_seen_by_a_point_network_are_those_of_the_image(views):
    batch = draw(views, ROWS, replace(GARMENTNETS, pixels=200), augment.TURNS, np.random.default_rng(2))
    np.testing.assert_allclose(batch.seen[0], batch.points, atol=1e-6)


def test_an_unchanged_view_is_the_stored_one(views, write_data):
    batch = draw(views, ROWS, WHOLE, augment.NONE, np.random.default_rng(0))
    heights = batch.seen[0][:, 0] / 20
    assert heights.max() < 0.07
    rows, columns = (batch.seen[1][0].numpy() * 200).astype(int).T
    depth = np.zeros((200, 200), np.float32)
    depth[rows, columns] = 0.65 - heights[0].numpy()[rows, columns]
    np.testing.assert_allclose(CAMERA.back_project(depth)[rows, columns], batch.points[0], atol=1e-4)


def test_the_paper_sees_raw_depth_with_nothing_around_it(views):
    image = draw(views, ROWS, PAPER, augment.TURNS, np.random.default_rng(0)).seen[0]
    assert image.shape == (5, 1, 200, 200)
    assert set(np.unique(image.numpy() > 0.5).tolist()) == {True, False}
    assert image[image > 0].min() > 0.5


def test_a_window_around_the_cloth_holds_it(views):
    batch = draw(views, ROWS, replace(CROP, size=128), TURNED, np.random.default_rng(3))
    whole = draw(views, ROWS, WHOLE, augment.NONE, np.random.default_rng(3))
    shares = batch.seen[0][:, 1].sum((1, 2)) / whole.seen[0][:, 1].sum((1, 2))
    assert shares.min() > 0.95


def test_batches_depend_on_the_generator_alone(views):
    first, again, other = (draw(views, ROWS, CPU, Augmentation(), np.random.default_rng(k)) for k in (7, 7, 8))
    assert torch.equal(first.seen[0], again.seen[0])
    assert torch.equal(first.nocs, again.nocs)
    assert not torch.equal(first.seen[0], other.seen[0])


def test_noise_changes_depth_by_millimetres_and_the_mask_at_its_rim_only():
    depth = np.zeros((40, 64, 64), np.float32)
    depth[:, 16:48, 16:48] = 0.62
    a = Augmentation()
    seen, mask = measured(depth, 0.65, replace(a, holes=0), np.random.default_rng(0))
    inner = np.s_[:, 17:47, 17:47]
    assert mask[inner].all()
    assert not mask[:, :15].any()
    assert not mask[:, :, 49:].any()
    rim = mask[:, 16:48, 16:48].sum() - mask[inner].sum()
    assert 0.7 * 40 * 124 < rim < 40 * 124
    assert mask[:, 15].any()
    offsets = (seen[inner] - 0.62).mean((1, 2))
    assert offsets.std() == pytest.approx(a.offset_m, rel=0.5)
    noise = (seen[inner] - 0.62 - offsets[:, None, None]).std((1, 2))
    assert noise.max() < 1.1 * a.noise_m
    assert noise.min() < 0.3 * a.noise_m
    assert (seen[~mask] == 0).all()


def test_nothing_to_change_changes_nothing():
    depth = np.random.default_rng(0).random((2, 8, 8)).astype(np.float32)
    seen, mask = measured(depth, 0.65, augment.NONE, np.random.default_rng(0))
    np.testing.assert_array_equal(seen, depth)
    assert mask.all()


def test_data_that_cannot_be_learnt_from_is_refused(write_data):
    with pytest.raises(DatasetError, match="split 'train'"):
        Views.read([write_data(split="test")], ["tshirt"], "train")
    with pytest.raises(DatasetError, match="NOCS box"):
        Views.read([write_data(box=[[0, 0, 0], [1, 1, 1]])], ["tshirt"], "train")
    with pytest.raises(DatasetError, match="found none of skirt"):
        Views.read([write_data()], ["tshirt", "skirt"], "train")


def test_views_of_several_categories_keep_their_names(write_data):
    views = Views.read([write_data("skirt"), write_data("tshirt")], ["tshirt", "skirt"], "train")
    assert len(views) == 10
    assert views.of("skirt").tolist() == [0, 1, 2, 3, 4]
    assert views.of("tshirt").tolist() == [5, 6, 7, 8, 9]
