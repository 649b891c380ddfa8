import io

import numpy as np
import pytest
from PIL import Image

from medor_cloth.camera import overhead
from medor_cloth.picture import depth_from_png16, depth_picture, png16_bytes, png_bytes, shade
from medor_cloth.raster import rasterize


def test_a_depth_image_survives_the_png_to_half_a_grey_level():
    depth = np.random.default_rng(0).uniform(0.5, 0.65, (37, 53)).astype(np.float32)
    depth[:5] = 0
    read = depth_from_png16(png16_bytes(depth))
    assert read.dtype == np.float32
    assert read.shape == depth.shape
    np.testing.assert_allclose(read, depth, atol=0.51e-4)
    assert not read[:5].any()
    np.testing.assert_array_equal(depth_from_png16(png16_bytes(read)), read)


def test_depths_a_png_cannot_hold_are_refused():
    for bad in (-0.1, 6.6, np.nan):
        with pytest.raises(ValueError, match="depths from 0"):
            png16_bytes(np.array([[0.5, bad]]))


def test_files_that_are_no_depth_image_are_refused():
    whole = png16_bytes(np.full((64, 64), 0.5))
    eight_bit = png_bytes(np.zeros((4, 4, 3), np.uint8))
    for bad in (b"", b"not a picture", whole[: len(whole) // 2], eight_bit):
        with pytest.raises(ValueError, match="expected a"):
            depth_from_png16(bad)


def test_a_picture_survives_the_png_exactly():
    rgb = np.random.default_rng(1).integers(0, 256, (9, 13, 3), np.uint8)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png_bytes(rgb)))), rgb)


def test_brightness_follows_the_slope_and_only_cloth_is_drawn():
    camera = overhead(60)
    square = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    light = {}
    for name, slope in (("to the light", 0.3), ("flat", 0.0), ("away", -0.3)):
        raster = rasterize(
            square + square[:, :1] * np.array([0, 0, slope], np.float32) + np.array([0, 0, 0.05], np.float32),
            faces,
            camera,
        )
        picture = shade(raster, camera)
        assert picture.shape == (60, 60, 3)
        assert picture.dtype == np.uint8
        assert (picture[~raster.mask] == picture[0, 0]).all()
        light[name] = picture[30, 30].mean()
    assert light["to the light"] > light["flat"] > light["away"]


def test_higher_layers_look_different_and_brighter():
    depth = np.array([[0, 0.65, 0.645, 0.64, 0.6, 0.3]])
    picture = depth_picture(depth)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) == 6
    assert (np.diff(picture[0, 1:].astype(float) @ [0.3, 0.6, 0.1]) > 0).all()
