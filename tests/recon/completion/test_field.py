from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_cloth.nocs import NOCS
from medor_recon.completion.augment import Augmentation
from medor_recon.completion.field import Field, FieldConfig
from medor_recon.completion.field_completion import FieldCompletion, winding_grid
from medor_recon.completion.field_task import FieldTask
from medor_recon.completion.frame import WORLD, laid_flat
from medor_recon.completion.material import Material
from medor_recon.completion.observations import observations
from medor_recon.completion.pixels import Pixels, thinned
from medor_recon.completion.presets import PRESETS
from medor_wire.errors import ReconstructionFailed

TINY = FieldConfig(
    features=0,
    aggregation=(16, 8),
    grid=8,
    maps=8,
    levels=2,
    volume_features=8,
    decoder=(32,),
    batch_norm=False,
    framed=True,
    position_weight=100.0,
    nodes=24,
)


@pytest.fixture(scope="module")
def pixels(seen) -> Pixels:
    return thinned(seen, 0.01)


def net(**changes) -> Field:
    torch.manual_seed(0)
    return Field(replace(TINY, **changes), ("tshirt",)).eval()


@pytest.mark.parametrize("framed", [True, False])
def test_relative_is_absolute_plus_the_canonical_point(pixels, garment, framed):
    relative, absolute = net(framed=framed), net(framed=framed, relative=False)
    frame = relative.frame(pixels)
    start = laid_flat(garment.vertices) if framed else garment.vertices
    difference = frame.inward(relative.warp(pixels, garment.vertices)) - frame.inward(
        absolute.warp(pixels, garment.vertices)
    )
    np.testing.assert_allclose(difference, start, atol=1e-5)


def test_a_frameless_field_lives_in_the_world(pixels):
    assert net(framed=False).frame(pixels) is WORLD


def test_the_order_of_the_pixels_does_not_matter(pixels, garment):
    shuffled = np.random.default_rng(0).permutation(len(pixels.points))
    parts = (part[shuffled] for part in (pixels.points, pixels.nocs, pixels.confidence, pixels.features))
    field = net()
    np.testing.assert_allclose(
        field.warp(Pixels("tshirt", *parts), garment.vertices), field.warp(pixels, garment.vertices), atol=1e-5
    )


def test_views_of_a_batch_do_not_mix(pixels):
    field = net()
    other = replace(pixels, points=pixels.points[::2], nocs=pixels.nocs[::2], confidence=pixels.confidence[::2])
    other = replace(other, features=other.features[::2])
    together = field.volume([pixels, other])
    torch.testing.assert_close(together[1:], field.volume([other]), atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(together[:1], field.volume([pixels]), atol=1e-5, rtol=1e-4)


def test_the_grid_is_decoded_in_chunks_as_a_whole(pixels, monkeypatch):
    field = net()
    volume = field.volume([pixels]).detach()
    whole = winding_grid(field, volume)
    monkeypatch.setattr("medor_recon.completion.field_completion.CHUNK", 1000)
    np.testing.assert_allclose(winding_grid(field, volume), whole, atol=1e-6)
    query = torch.tensor([[[3 / 23, 7 / 23, 20 / 23]]])
    assert field.winding(volume, query).item() == pytest.approx(whole[3, 7, 20], abs=1e-5)


def test_published_features_are_read(seen):
    torch.manual_seed(0)
    config = replace(PRESETS["paper"].network, maps=8, levels=2, grid=8, volume_features=8)
    assert isinstance(config, FieldConfig)
    field = Field(config, ("tshirt",)).eval()
    pixels = thinned(replace(seen, features=np.random.default_rng(0).random((len(seen.points), 480), np.float32)), 0.02)
    changed = replace(pixels, features=pixels.features + 1)
    assert not torch.equal(field.volume([pixels]), field.volume([changed]))


def test_one_view_is_learnt_by_heart_and_completed(data, seen):
    """What the parts are for, together: the surface, its openings and its place are read back from the fields."""
    config = replace(TINY, grid=12, volume_features=16, decoder=(64, 64))
    torch.manual_seed(0)
    found = observations(data, ("tshirt",), 0.008)[:1]
    still = Augmentation(0, (0.0,), 0, 0, 0, 0, 0, 0)
    task = FieldTask(Field(config, ("tshirt",)), Material(found, found), still, 0, 1, 800, 300)
    optimizer = torch.optim.Adam(task.module.parameters(), 5e-3)
    task.module.train()
    first = last = task.loss(0).item()
    for step in range(120):
        loss = task.loss(step)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        last = loss.item()
    assert last < first / 8
    completed = FieldCompletion(task.module, {"tshirt": 0.05}, 0.008).complete(seen)
    true = NOCS["tshirt"].decode(found[0].shape.nocs)
    distance = np.linalg.norm(completed.canonical[:, None] - true[None], axis=2)
    assert distance.min(axis=1).mean() < 0.015
    errors = np.linalg.norm(completed.positions - found[0].positions[distance.argmin(axis=1)], axis=1)
    assert errors.mean() < 0.025


def test_a_field_that_has_not_learnt_is_refused(seen):
    with pytest.raises(ReconstructionFailed):
        FieldCompletion(net(), {}, 0.01).complete(seen)
