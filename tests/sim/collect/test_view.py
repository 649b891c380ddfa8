"""`medor view` on collected data."""

import numpy as np
import pytest
from PIL import Image

from medor_cloth.errors import DatasetError
from medor_cloth.footage import load
from medor_cloth.view import main


def test_a_pull_is_shown_in_time_with_its_arrow(dynamics_data, tmp_path):
    footage = load(dynamics_data.folder, 1)
    np.testing.assert_array_equal(footage.states, dynamics_data[1]["positions"])
    assert footage.seconds == 0.05
    main([str(dynamics_data.folder), "--index", "1", "--out", str(tmp_path / "a.gif"), "--width", "48"])
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == len(footage.states)  # type: ignore[attr-defined]
        assert gif.info["duration"] == 150, "three times slower than life"


def test_an_observation_is_shown_with_the_pick_that_follows(recon_data):
    footage = load(recon_data.folder)
    assert footage.moves is not None
    np.testing.assert_array_equal(footage.moves[:-1], recon_data[0]["moves"][1:])
    assert np.isnan(footage.moves[-1]).all()


def test_an_index_beyond_the_data_names_its_range(recon_data):
    with pytest.raises(DatasetError, match=f"from 0 to {len(recon_data) - 1}, got 99"):
        load(recon_data.folder, 99)
