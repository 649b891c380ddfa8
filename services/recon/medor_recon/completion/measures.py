"""How far a completed garment is from the true one."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_cloth.camera import Camera
from medor_cloth.nocs import NOCS
from medor_cloth.raster import visible_vertices
from medor_recon.completed import Completed
from medor_recon.completion.augment import Example
from medor_recon.completion.pixels import Pixels

UNIT_M = 0.507
"""Length 1.0 of the chamfer figures without a unit: the side of the T-shirts' cube without its margin."""
SAMPLES = 4000
"""Points that stand for a surface."""

Warp = Callable[[Pixels, NDArray[np.float32]], NDArray[np.float32]]
"""Pixels of a view and canonical points (Q, 3) [m] to where they lie on the table (Q, 3)."""


def warp_errors(warp: Warp, examples: list[Example], camera: Camera) -> dict[str, float]:
    """Mean error of the true vertices' positions [cm], of all, of those the camera sees and of the hidden ones."""
    errors = [np.linalg.norm(warp(item.pixels, canonical_of(item)) - item.positions, axis=1) for item in examples]
    seen = [visible_vertices(item.positions, item.faces, camera) for item in examples]
    return _by_visibility(np.concatenate(errors), np.concatenate(seen))


def mesh_errors(completed: Completed, item: Example, camera: Camera, rng: np.random.Generator) -> dict[str, float]:
    """Errors of one completed mesh.

    A true vertex corresponds to the completed vertex nearest to it in canonical space.

    Returns:
        `error_cm`, `visible_cm`, `hidden_cm`: mean distances of corresponding vertices on the table. `to_true_cm` and
        `from_true_cm`: mean distance of one canonical surface to the other, one way each; `chamfer_cm` their mean, and
        `chamfer` in units of 50.7 cm.
    """
    canonical = canonical_of(item)
    _, nearest = KDTree(completed.canonical).query(canonical)
    errors = np.linalg.norm(completed.positions[nearest] - item.positions, axis=1)
    found = _spread(completed.canonical, completed.faces, rng)
    true = _spread(canonical, item.faces, rng)
    to_true, from_true = (float(KDTree(b).query(a)[0].mean()) for a, b in ((found, true), (true, found)))
    both = (to_true + from_true) / 2
    shape = {"to_true_cm": to_true * 100, "from_true_cm": from_true * 100, "chamfer_cm": both * 100}
    seen = visible_vertices(item.positions, item.faces, camera)
    return _by_visibility(errors, seen) | shape | {"chamfer": both / UNIT_M}


def canonical_of(item: Example) -> NDArray[np.float32]:
    """Vertices (V, 3) of an example's shape, canonical space [m]."""
    return NOCS[item.pixels.category].decode(item.nocs)


def mean_of(rows: list[dict[str, float]]) -> dict[str, float]:
    """The mean of each measure over the rows that have it."""
    return {name: float(np.nanmean([row[name] for row in rows])) for name in rows[0]} if rows else {}


def _by_visibility(errors: NDArray[np.floating], seen: NDArray[np.bool_]) -> dict[str, float]:
    groups = {"error_cm": errors, "visible_cm": errors[seen], "hidden_cm": errors[~seen]}
    return {name: float(group.mean()) * 100 if len(group) else np.nan for name, group in groups.items()}


def _spread(vertices: NDArray[np.floating], faces: NDArray[np.integer], rng: np.random.Generator) -> NDArray:
    """Points (SAMPLES, 3) spread evenly over a surface."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(area), SAMPLES, p=area / area.sum())
    u, v = rng.random((2, SAMPLES, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return corners[face, 0] * (1 - u - v) + corners[face, 1] * u + corners[face, 2] * v
