"""Data sets of analytic sheets."""

from pathlib import Path

import numpy as np
import pytest
import zarr

from medor_cloth.dataset import FORMAT, STORED, box_of
from medor_cloth.nocs import NOCS
from tests.recon.canonical.sheets import view


@pytest.fixture(scope="session")
def write_data(tmp_path_factory):
    """Writes a data set of one garment and one trajectory of five views; gives its folder."""

    def write(category: str = "tshirt", split: str = "train", box: list | None = None) -> Path:
        folder = tmp_path_factory.mktemp("data")
        shard = zarr.open_group(folder / "shard-0000-of-0001.zarr", mode="w")
        plan = {"kind": "recon", "split": split, "seed": 3, "nocs_box": box or box_of(category)}
        shard.attrs.update({"format": FORMAT, "plan": plan})
        garment = shard.create_group("garment-000000")
        seed = 5 if split == "train" else 800_005
        garment.attrs.update({"category": category, "seed": seed, "first": 0})
        views = [view((20 + 15 * k, 60 - 10 * k), (60 + 5 * k, 50)) for k in range(5)]
        for name in ("depth", "mask", "nocs"):
            values = np.stack([one[name] for one in views])[None]
            garment.create_array(name, data=STORED[name].store(values) if name in STORED else values)
        garment.create_array("complete", data=np.ones(1, bool))
        return folder

    return write


@pytest.fixture(scope="session")
def boxes():
    return {category: box_of(category) for category in NOCS}
