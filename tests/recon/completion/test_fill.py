from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_cloth.nocs import NOCS
from medor_recon.completion.fill import FillConfig, PooledFill, fill
from medor_recon.completion.frame import garment_frame
from medor_recon.completion.pixels import Pixels, pixel_size, thinned


@pytest.fixture(scope="module")
def pixels(seen) -> Pixels:
    return thinned(seen, 0.008)


@pytest.fixture(scope="module")
def net() -> PooledFill:
    torch.manual_seed(0)
    return PooledFill(FillConfig(hidden=(32,)), ("tshirt",)).eval()


def turned(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float32)


def test_the_fill_of_a_visible_point_is_that_point(pixels):
    canonical = NOCS["tshirt"].decode(pixels.nocs)
    np.testing.assert_allclose(fill(pixels, canonical, neighbours=8).positions, pixels.points, atol=1e-5)


def test_the_fill_stays_within_its_neighbours(pixels):
    canonical = np.random.default_rng(0).uniform(-0.2, 0.2, (50, 3))
    filled = fill(pixels, canonical, neighbours=4, softness=0.01)
    around = pixels.points[filled.neighbours]
    assert (filled.positions >= around.min(axis=1) - 1e-6).all()
    assert (filled.positions <= around.max(axis=1) + 1e-6).all()
    assert (np.diff(filled.distances, axis=1) >= 0).all()


def test_thinning_keeps_one_pixel_of_each_block(seen):
    kept = thinned(seen, 0.008)
    assert round(0.008 / pixel_size(seen)) == 3
    assert len(kept.points) == len(np.unique(seen.pixels // 3, axis=0))
    assert len(thinned(seen, 0.0).points) == len(seen.points)


def test_thinning_spares_what_is_thin_already(seen):
    few = np.random.default_rng(0).permutation(len(seen.points))[:300]
    parts = ("pixels", "points", "nocs", "confidence", "features")
    kept = thinned(replace(seen, **{part: getattr(seen, part)[few] for part in parts}), 0.008)
    assert len(kept.points) > 220


def test_the_frame_of_a_garment_laid_front_up_is_the_world_and_turns_with_it(pixels):
    frame = garment_frame(pixels)
    np.testing.assert_allclose(frame.R, np.eye(3), atol=0.05)
    np.testing.assert_allclose(frame.view(pixels).points[:, :2].mean(axis=0), 0, atol=1e-6)
    R = turned(2.0)
    moved = garment_frame(replace(pixels, points=pixels.points @ R.T))
    np.testing.assert_allclose(moved.R, R @ frame.R, atol=1e-4)
    np.testing.assert_allclose(moved.outward(moved.inward(pixels.points)), pixels.points, atol=1e-6)


def test_completion_turns_and_moves_with_the_garment(pixels, net, garment):
    canonical = garment.vertices[::7]
    R, t = turned(-1.1), np.array([0.03, -0.05, 0], np.float32)
    moved = replace(pixels, points=(pixels.points @ R.T + t).astype(np.float32))
    expected = net.positions(pixels, canonical) @ R.T + t
    np.testing.assert_allclose(net.positions(moved, canonical), expected, atol=2e-5)


def test_the_category_is_told_where_there_are_several(pixels):
    torch.manual_seed(0)
    net = PooledFill(FillConfig(hidden=(16,)), ("tshirt", "trousers")).eval()
    canonical = NOCS["tshirt"].decode(pixels.nocs[:5])
    as_shirt = net.positions(pixels, canonical)
    box = NOCS["trousers"]
    as_trousers = net.positions(
        replace(pixels, category="trousers", nocs=box.encode(NOCS["tshirt"].decode(pixels.nocs))), canonical
    )
    assert np.abs(as_shirt - as_trousers).max() > 1e-4
