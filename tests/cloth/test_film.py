import io

import numpy as np
import pytest
from PIL import Image, ImageSequence

from medor_cloth.camera import overhead
from medor_cloth.film import film, gif_bytes, png_sheet_bytes

SHEET = np.array([[0, 0, 0.01], [0.1, 0, 0.01], [0.1, 0.1, 0.01], [0, 0.1, 0.01]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


@pytest.fixture(scope="module")
def pictures():
    return film([SHEET + np.array([0.03 * k, 0, 0], np.float32) for k in range(3)], FACES, overhead(64))


def test_one_picture_a_state_and_the_cloth_moves(pictures):
    assert len(pictures) == 3
    columns = [np.argwhere(picture[..., 0] > picture[..., 2])[:, 1].mean() for picture in pictures]
    np.testing.assert_allclose(np.diff(columns), 0.03 / 0.64 * overhead(64).K[0, 0], atol=0.7)


def test_a_gif_holds_every_picture_for_its_time(pictures):
    with Image.open(io.BytesIO(gif_bytes(pictures, 0.2))) as gif:
        assert len(list(ImageSequence.Iterator(gif))) == 3
        assert gif.info["duration"] == 200
    with pytest.raises(ValueError, match="at least one"):
        gif_bytes([])


def test_a_sheet_shows_them_row_by_row(pictures):
    with Image.open(io.BytesIO(png_sheet_bytes(pictures))) as sheet:
        rows = np.asarray(sheet).reshape(2, 64, 2, 64, 3)
    np.testing.assert_array_equal(rows[0, :, 1], pictures[1])
    np.testing.assert_array_equal(rows[1, :, 0], pictures[2])
    assert len(np.unique(rows[1, :, 1].reshape(-1, 3), axis=0)) == 1, "nothing is left for the last place"
