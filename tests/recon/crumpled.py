"""A folded garment, what a camera sees of it, and completions of it that are wrong in known ways; no solver needed."""

from functools import lru_cache

import numpy as np
from scipy.spatial import KDTree

from medor_cloth.camera import overhead
from medor_cloth.garment import Garment, generate
from medor_cloth.nocs import NOCS
from medor_cloth.raster import rasterize
from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed

CAMERA = overhead(200)
FOLD = 0.02
"""Where the bend begins, world x [m]."""
RADIUS = 0.008
"""Of the bend [m]."""


@lru_cache
def garment() -> Garment:
    return generate("tshirt", 800_010, edge_m=0.015)


@lru_cache
def folded() -> np.ndarray:
    """(V, 3) world frame [m]: laid flat, what lies right of `FOLD` rolled over onto the rest; up to four layers."""
    flat = garment().laid_flat().astype(np.float64)
    flat[:, 2] += 0.006 - flat[:, 2].min()
    top = flat[:, 2].max()
    beyond = np.maximum(flat[:, 0] - FOLD, 0)
    around = np.minimum(beyond, np.pi * RADIUS)
    angle, inwards = around / RADIUS, top + RADIUS - flat[:, 2]
    x = np.minimum(flat[:, 0], FOLD) + inwards * np.sin(angle) - (beyond - around)
    return np.stack([x, flat[:, 1], top + RADIUS - inwards * np.cos(angle)], axis=1)


def seen(noise: float = 0.0, rng: np.random.Generator | None = None) -> Canonicalized:
    """The folded garment in a view of 200 px, its canonical coordinates right up to normal noise, in the NOCS cube."""
    shirt = garment()
    raster = rasterize(folded(), shirt.faces, CAMERA)
    corners = NOCS["tshirt"].encode(shirt.vertices)[shirt.faces[raster.face[raster.mask]]]
    nocs = (raster.barycentric[raster.mask][..., None] * corners).sum(axis=1)
    if rng is not None:
        nocs = np.clip(nocs + noise * rng.standard_normal(nocs.shape), 0, 1).astype(np.float32)
    return Canonicalized(
        category="tshirt",
        pixels=np.argwhere(raster.mask).astype(np.int32),
        points=CAMERA.back_project(raster.depth)[raster.mask],
        nocs=nocs,
        confidence=np.ones_like(nocs),
        features=np.empty((len(nocs), 0), np.float32),
        camera=CAMERA,
    )


def warped(rng: np.random.Generator, size: float) -> Completed:
    """The true mesh with a smooth error of that root mean square [m]."""
    shirt = garment()
    waves = np.sin(shirt.vertices @ (10 * rng.standard_normal((6, 3))).T + rng.uniform(0, 2 * np.pi, 6))
    error = waves @ rng.standard_normal((6, 3))
    error *= size / np.sqrt((error**2).sum(axis=1).mean())
    return Completed(shirt.vertices, shirt.faces, (folded() + error).astype(np.float32))


def filled(view: Canonicalized) -> Completed:
    """The true shape, each vertex amid the points seen nearest to it in canonical space: what is hidden hangs behind.

    The error is that of a completion which has learnt nothing.
    """
    shirt = garment()
    distance, near = KDTree(NOCS["tshirt"].decode(view.nocs)).query(shirt.vertices, k=8)
    weights = 1 / (distance + 0.005) ** 2
    positions = (weights[..., None] * view.points[near]).sum(axis=1) / weights.sum(axis=1, keepdims=True)
    return Completed(shirt.vertices, shirt.faces, positions.astype(np.float32))
