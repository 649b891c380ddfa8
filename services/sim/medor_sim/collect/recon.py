"""Trajectories for learning to see: five observations of a garment that is picked at (MEDOR, section 5.1)."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera, overhead
from medor_cloth.raster import Raster, rasterize
from medor_cloth.solver import ClothState
from medor_cloth.start import dropped
from medor_sim.collect.carry import carry, random_carry
from medor_sim.collect.scene import Scene

OBSERVATIONS = 5
CAMERA = overhead(200)
DROPPED_SHARE = 0.5
"""How often a trajectory starts from a drop instead of a carry from flat."""


def trajectory(scene: Scene, rng: np.random.Generator) -> dict[str, NDArray] | None:
    """One trajectory's arrays, named and shaped as `medor_cloth.dataset` says, in SI units.

    Returns:
        None when a carry took hold of nothing or a part of the cloth left the view: nothing of it is kept.
    """
    state, move = scene.flat, np.full((2, 3), np.nan)
    view = look(scene, state)
    seen = []
    for step in range(OBSERVATIONS):
        if step == 0 and rng.random() < DROPPED_SHARE:
            after = dropped(scene.solver, scene.flat, rng)
        else:
            drawn = random_carry(view, CAMERA, rng)
            after, move = carry(scene.solver, state, drawn), np.stack([drawn.pick, drawn.place])
        if after is None or not CAMERA.contains(after.positions).all():
            return None
        state, view = after, look(scene, after)
        seen.append(observation(scene, state, view) | {"moves": move.astype(np.float32)})
    return {name: np.stack([one[name] for one in seen]) for name in seen[0]}


def look(scene: Scene, state: ClothState, camera: Camera = CAMERA) -> Raster:
    """What the camera sees of the cloth."""
    return rasterize(state.positions, scene.garment.faces, camera)


def observation(scene: Scene, state: ClothState, view: Raster) -> dict[str, NDArray]:
    """What is stored of one view."""
    return {
        "depth": view.depth,
        "mask": view.mask,
        "nocs": nocs_map(view, scene.garment.faces, scene.nocs),
        "positions": state.positions,
    }


def nocs_map(view: Raster, faces: NDArray[np.int32], nocs: NDArray[np.float32]) -> NDArray[np.float32]:
    """NOCS of the surface at every pixel (H, W, 3), exact by the face's barycentric coordinates; 0 off the cloth."""
    corners = nocs[faces[view.face]]
    return np.where(view.mask[..., None], (view.barycentric[..., None] * corners).sum(axis=2), 0).astype(np.float32)
