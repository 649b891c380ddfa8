"""Garments laid flat, seen by a faultless canonicaliser, and a data set of them."""

from pathlib import Path

import numpy as np
import pytest
import zarr

from medor_cloth.camera import overhead
from medor_cloth.dataset import FORMAT, STORED, box_of
from medor_cloth.garment import Garment, generate
from medor_cloth.nocs import NOCS
from medor_cloth.raster import rasterize
from medor_recon.canonicalized import Canonicalized

CAMERA = overhead(200)
SEEDS = (3, 4)


@pytest.fixture(scope="session")
def garments() -> list[Garment]:
    return [generate("tshirt", seed, edge_m=0.02) for seed in SEEDS]


@pytest.fixture(scope="session")
def garment(garments) -> Garment:
    return garments[0]


@pytest.fixture(scope="session")
def laid(garment) -> np.ndarray:
    """(V, 3) its vertices on the table, smoothed out by hand."""
    return garment.laid_flat()


@pytest.fixture(scope="session")
def seen(garment, laid) -> Canonicalized:
    """What a faultless canonicaliser says of it."""
    raster = rasterize(laid, garment.faces, CAMERA)
    pixels = np.argwhere(raster.mask).astype(np.int32)
    rows, columns = pixels.T
    points = interpolated(laid, garment.faces, raster)[rows, columns]
    nocs = interpolated(NOCS["tshirt"].encode(garment.vertices), garment.faces, raster)[rows, columns]
    none = np.zeros((len(pixels), 0), np.float32)
    return Canonicalized("tshirt", pixels, points, nocs, np.ones_like(nocs), none, CAMERA)


@pytest.fixture(scope="session")
def data(garments, tmp_path_factory) -> Path:
    """A data set: of each garment one trajectory, five times laid flat another way."""
    folder = tmp_path_factory.mktemp("data")
    shard = zarr.open_group(folder / "shard-0000-of-0001.zarr", mode="w")
    shard.attrs.update(
        {"format": FORMAT, "plan": {"kind": "recon", "split": "train", "nocs_box": box_of("tshirt"), "seed": 0}}
    )
    for number, garment in enumerate(garments):
        group = shard.create_group(f"garment-{number:06d}")
        group.attrs.update({"category": "tshirt", "seed": garment.seed, "first": number})
        views = [labelled(garment, garment.laid_flat() @ turned(angle).T) for angle in range(5)]
        arrays = {name: np.stack([one[name] for one in views])[None] for name in views[0]}
        arrays |= {
            "vertices": garment.vertices,
            "faces": garment.faces,
            "panel_uv": garment.panel_uv,
            "complete": np.ones(1, bool),
        }
        for name, values in arrays.items():
            group.create_array(name, data=STORED[name].store(values) if name in STORED else values)
    return folder


def labelled(garment: Garment, positions: np.ndarray) -> dict[str, np.ndarray]:
    """What a data set stores of one view."""
    raster = rasterize(positions, garment.faces, CAMERA)
    nocs = interpolated(NOCS["tshirt"].encode(garment.vertices), garment.faces, raster)
    return {"depth": raster.depth, "mask": raster.mask, "nocs": nocs, "positions": positions}


def interpolated(values, faces, raster) -> np.ndarray:
    """(H, W, 3) values of the vertices at every pixel, 0 off the cloth."""
    at = (raster.barycentric[..., None] * values[faces[raster.face]]).sum(axis=2)
    return np.where(raster.mask[..., None], at, 0).astype(np.float32)


def turned(angle: float) -> np.ndarray:
    """(3, 3) turn about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float32)
