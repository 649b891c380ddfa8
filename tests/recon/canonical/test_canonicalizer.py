"""From a depth view to canonical coordinates, with a network that has just been learnt by heart."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_cloth.camera import Camera, overhead
from medor_learn import weights
from medor_learn.errors import WeightsError
from medor_learn.loop import Schedule, train
from medor_recon.canonical.canonicalizer import Canonicalizer
from medor_recon.canonical.network import build
from medor_recon.canonical.overhead import overhead_depth
from medor_recon.canonical.preset import CPU, GARMENTNETS
from medor_recon.canonical.task import CanonicalTask
from medor_recon.canonical.views import Views
from medor_wire.errors import BadRequest, NoGarment
from tests.recon.canonical.sheets import CAMERA, label, view

PRESET = replace(CPU, width=8, modules=(1, 1), blocks=1, stem=16, hidden=64, size=96, pixels=64, batch=5)


def config(boxes, preset=PRESET, categories=("tshirt",)):
    return {"preset": preset.to_json(), "categories": list(categories), "nocs_boxes": boxes}


def fresh(boxes, preset=PRESET, categories=("tshirt",)) -> Canonicalizer:
    torch.manual_seed(0)
    card = config(boxes, preset, categories)
    return Canonicalizer(build(card), card)


def overhead_view(width=200, height=0.0):
    """A sheet as an overhead camera of a resolution sees it, and the camera."""
    depth = view((40, 50), (70, 80))["depth"]
    depth = np.where(depth > 0, depth - height, 0).astype(np.float32)
    return depth.repeat(width // 200, 0).repeat(width // 200, 1), overhead(width)


def test_pixels_points_and_answers_belong_together(boxes):
    depth, camera = overhead_view(600)
    seen = fresh(boxes).canonicalize("tshirt", depth, camera)
    assert len(seen.pixels) == (depth > 0).sum() / 9
    rows, columns = seen.pixels.T
    small, _ = overhead_view(200)
    np.testing.assert_allclose(seen.points, CAMERA.back_project(small)[rows, columns], atol=1e-6)
    assert seen.nocs.shape == seen.confidence.shape == seen.points.shape
    assert seen.features.shape == (len(seen.pixels), PRESET.channels)
    assert 0 <= seen.nocs.min() <= seen.nocs.max() <= 1
    assert 1 / 64 <= seen.confidence.min() <= seen.confidence.max() <= 1


def test_moving_the_garment_moves_the_answer(boxes):
    canonicalizer = fresh(boxes)
    depth, camera = overhead_view()
    moved = np.roll(depth, (12, -8), (0, 1))
    here, there = (canonicalizer.canonicalize("tshirt", image, camera) for image in (depth, moved))
    np.testing.assert_allclose(here.nocs, there.nocs, atol=1e-4)
    np.testing.assert_array_equal(here.pixels + (12, -8), there.pixels)


def test_a_garment_larger_than_the_window_is_seen_as_a_whole(boxes):
    depth = view((10, 5), (180, 190))["depth"]
    assert len(fresh(boxes).canonicalize("tshirt", depth, CAMERA).pixels) == (depth > 0).sum()


@pytest.mark.parametrize("preset", [replace(PRESET, view="whole"), replace(GARMENTNETS, pixels=500)])
def test_every_kind_of_network_answers(boxes, preset):
    depth, camera = overhead_view()
    seen = fresh(boxes, preset).canonicalize("tshirt", depth, camera)
    assert len(seen.pixels) == min((depth > 0).sum(), preset.pixels if preset.network == "pointnet" else 10**6)
    rows, columns = seen.pixels.T
    np.testing.assert_allclose(seen.points, CAMERA.back_project(depth)[rows, columns], atol=1e-6)


def test_a_shirt_has_two_answers_half_a_turn_apart_and_a_skirt_one(boxes):
    depth, camera = overhead_view()
    canonicalizer = fresh(boxes, categories=("tshirt", "skirt"))
    first, second = canonicalizer.hypotheses("tshirt", depth, camera)
    assert first.probability >= second.probability
    assert first.probability + second.probability == pytest.approx(1)
    np.testing.assert_allclose((first.canonicalized.nocs + second.canonicalized.nocs)[:, :2], 1, atol=1e-5)
    np.testing.assert_allclose(first.canonicalized.nocs[:, 2], second.canonicalized.nocs[:, 2], atol=1e-6)
    assert [one.probability for one in canonicalizer.hypotheses("skirt", depth, camera)] == [1.0]


def test_what_cannot_be_answered_is_said(boxes):
    depth, camera = overhead_view()
    with pytest.raises(BadRequest, match="tshirt, got 'skirt'"):
        fresh(boxes).canonicalize("skirt", depth, camera)
    with pytest.raises(NoGarment):
        fresh(boxes).canonicalize("tshirt", np.zeros_like(depth), camera)


def test_a_network_taught_in_another_cube_is_refused(boxes):
    other = {**boxes, "tshirt": [[-1, -1, -1], [1, 1, 1]]}
    with pytest.raises(WeightsError, match="NOCS box"):
        fresh(other)


def test_another_camera_sees_what_the_overhead_camera_would_see():
    depth, _ = overhead_view()
    tilt = np.radians(20)
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    T = overhead().T_world_camera.copy()
    T[:3, :3] = turn @ T[:3, :3]
    T[:3, 3] = turn @ (0, 0, 0.75)
    camera = Camera(overhead(600).K, T, 600, 600)
    height = camera.position[2] + 0 * camera.rays()[..., 2]
    table = np.where(np.abs(camera.rays()[..., 2]) > 0, (height - 0.03) / -camera.rays()[..., 2], 0)
    points = camera.back_project(table.astype(np.float32))
    patch = (np.abs(points[..., :2]) < 0.08).all(-1)
    seen = overhead_depth(np.where(patch, table, 0).astype(np.float32), camera)
    assert np.unique(np.round(seen[seen > 0], 3)).tolist() == pytest.approx([0.62])
    area = (seen > 0).sum() * (0.62 / CAMERA.K[0, 0]) ** 2
    assert area == pytest.approx(0.16**2, rel=0.06)
    assert (seen > 0)[100, 100]
    np.testing.assert_array_equal(overhead_depth(depth, CAMERA), depth)


def test_training_ends_in_weights_that_answer(write_data, boxes, tmp_path):
    """Labels of these sheets are where they lie on the table, which a network that sees only a window cannot know;
    shown the whole image and never turned, it learns them."""
    preset = replace(PRESET, view="whole", rough=False, pixels=200, symmetric=False)
    data, test = write_data(), write_data(split="test")
    views, held_out = Views.read([data], ["tshirt"], "train"), Views.read([test], ["tshirt"], "test")
    torch.manual_seed(0)
    card = config(boxes, preset)
    task = CanonicalTask(build(card), preset, views, held_out)
    task.augmentation = replace(task.augmentation, turn_deg=0.0)
    schedule = Schedule(steps=80, lr=5e-3, warm_up=5, validate_every=40, bf16=True)
    summary = train(task, tmp_path, schedule, card=card)
    before = fresh(boxes, preset)
    after = Canonicalizer.load(tmp_path / "best", "cpu")
    depth, camera = overhead_view()
    errors = [_error(one.canonicalize("tshirt", depth, camera)) for one in (before, after)]
    assert errors[1] < 0.3 * errors[0]
    assert summary["best"]["tshirt/plain"] < 0.08
    found = weights.read_config(tmp_path / "best")
    assert found["metrics"]["score"] == summary["best"]["score"] == pytest.approx(summary["best"]["tshirt/aware"])


def _error(seen) -> float:
    return float(np.linalg.norm(seen.nocs - label(seen.points), axis=1).mean())
