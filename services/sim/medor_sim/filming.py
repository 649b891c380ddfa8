"""A film of the arm at work: `python -m medor_sim.filming --category tshirt --out runs/arm.gif` (or .png: a sheet).

Lays a garment out, lets the Panda pull the vertex farthest from the middle outwards, and draws world and cloth with
PyBullet's software renderer.
"""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import tyro
from numpy.typing import NDArray

from medor_cloth.film import gif_bytes, png_sheet_bytes
from medor_cloth.raster import visible_vertices
from medor_cloth.solver import ClothState
from medor_sim.panda import Motion, plan
from medor_sim.picking import by_panda
from medor_sim.scene import Scene
from medor_sim.wardrobe import Wardrobe
from medor_sim.world import World
from medor_wire.messages import Category, StartState

SIZE_PX = (480, 360)
EYE_M, TARGET_M, FIELD_DEG = (0.75, -0.75, 0.5), (-0.1, 0.0, 0.12), 40.0
LIGHT = (0.5, -1.0, 2.0)
CLOTH_COLOUR = (0.25, 0.5, 0.8, 1.0)
LIFT_M = 0.01
"""Picker centre over the vertex it takes, as the planner has it [m]."""


@dataclass(frozen=True)
class Options:
    """What to film."""

    category: Category = "tshirt"
    garment_seed: int = 800000
    state: StartState = "drop"
    seed: int = 0
    length: float = 0.15
    """Of the pull [m]."""
    every: int = 8
    """Frames of 0.01 s between two pictures."""
    out: Path = Path("runs/arm.gif")
    """Ends in .gif for a film, in .png for a sheet."""


class Studio:
    """Draws a world with a cloth (V,3), (F,3) in it."""

    def __init__(self, world: World, faces: NDArray[np.int32]) -> None:
        self._client: Any = world._client
        self._arm = world.arm
        self._faces = faces
        self._indices = np.concatenate([faces, faces[:, ::-1]]).ravel().tolist()  # seen from both sides
        self._view = self._client.computeViewMatrix(EYE_M, TARGET_M, (0, 0, 1))
        self._lens = self._client.computeProjectionMatrixFOV(FIELD_DEG, SIZE_PX[0] / SIZE_PX[1], 0.05, 5.0)

    def picture(self, motion: Motion, frame: int, cloth: NDArray[np.float32]) -> NDArray[np.uint8]:
        """(H, W, 3) the arm at the end of a frame and the cloth's vertices as they are then."""
        self._arm.move_to(motion.joints[frame], motion.openings[frame])
        normals = _normals(cloth, self._faces)
        shape = self._client.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=cloth.tolist(),
            indices=self._indices,
            normals=normals.tolist(),
            rgbaColor=CLOTH_COLOUR,
        )
        body = self._client.createMultiBody(0, -1, shape)
        image = self._client.getCameraImage(
            *SIZE_PX, self._view, self._lens, shadow=1, lightDirection=LIGHT, renderer=pybullet.ER_TINY_RENDERER
        )[2]
        self._client.removeBody(body)
        return np.reshape(image, (SIZE_PX[1], SIZE_PX[0], 4))[..., :3].astype(np.uint8)


def _normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """(V,3) unit normals."""
    corners = vertices[faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros((len(vertices), 3))
    np.add.at(sums, faces.ravel(), np.repeat(across, 3, axis=0))
    return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)


def outward_pull(scene: Scene, world: World, length: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pick and place (3,) [m]: the outermost vertex in view, pulled away from the middle and a little up."""
    positions = scene.cloth.positions.astype(np.float64)
    seen = positions[visible_vertices(scene.cloth.positions, scene.piece.garment.faces, world.camera)]
    outwards = seen - positions.mean(axis=0)
    outwards[:, 2] = 0
    farthest = np.linalg.norm(outwards, axis=1).argmax()
    pick = seen[farthest] + [0, 0, LIFT_M]
    way = outwards[farthest] / np.linalg.norm(outwards[farthest]) + [0, 0, 0.5]
    return pick, pick + length * way / np.linalg.norm(way)


def film_pull(options: Options) -> list[NDArray[np.uint8]]:
    """Pictures of one pick-and-place, from parked to parked."""
    scene = Scene.begin(Wardrobe().generated(options.category, options.garment_seed), options.state, options.seed)
    with closing(World()) as world:
        motion = plan(world.arm, *outward_pull(scene, world, options.length))
        states: dict[int, NDArray[np.float32]] = {}

        def record(frame: int, cloth: ClothState) -> ClothState:
            states[frame] = cloth.positions
            return cloth

        after = by_panda(scene, motion, "good", lambda: None, [record]).scene.cloth.positions
        studio, lying = Studio(world, scene.piece.garment.faces), scene.cloth.positions
        pictures = []
        for frame in range(0, len(motion.joints), options.every):
            lying = states.get(frame, lying if frame < motion.done else after)
            pictures.append(studio.picture(motion, frame, lying))
        return pictures


def main(options: Options) -> None:
    pictures = film_pull(options)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    as_sheet = options.out.suffix == ".png"
    options.out.write_bytes(png_sheet_bytes(pictures) if as_sheet else gif_bytes(pictures, options.every * 0.01))


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
