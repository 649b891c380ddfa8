"""Candidates of random shooting: pixels around the garment, snapped to the vertices the camera sees.

MEDOR, section IV-C: a uniform pixel of the garment's bounding box becomes the nearest visible vertex, so that all
pixels off the cloth fall on its outline, where unfolding picks are; the place lies 5 to 20 cm away, never lower.
A mesh may believe cloth where none was seen; the picker would close on nothing there, so nobody picks it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_cloth.camera import Camera
from medor_cloth.grasp import REACH_M
from medor_wire.errors import NoGarment, OutOfReach, ReconstructionFailed
from medor_wire.messages import ClothMesh, DepthView

MARGIN = 30 / 720
"""Margin around the garment's bounding box, in image widths (30 px of 720)."""
SURFACE_HEIGHT_M = 0.005
"""Height at which a pixel without cloth meets the scene [m]."""
PICKER_ABOVE_M = 0.01
"""The picker's centre above the picked vertex [m]."""
ABOVE = np.array([0, 0, PICKER_ABOVE_M], np.float32)
LENGTHS_M = (0.05, 0.2)
"""Shortest and longest distance from pick to place [m]."""
DIRECTIONS_PER_PICK = 16
"""How often direction and length are drawn for one pick before the pick itself is given up."""
ROUNDS = 10
"""How often missing candidates are proposed anew."""

Test = Callable[[NDArray[np.float32]], NDArray[np.bool_]]
"""Points (..., 3) [m] -> (...) bool."""
Reachable = Callable[[NDArray[np.float32], NDArray[np.float32]], NDArray[np.bool_]]
"""Picks and places (N, 3) [m] -> (N,) bool: whether the cell can do the pull between them."""


@dataclass(frozen=True)
class Candidates:
    """K pick-and-places in task space [m]: picker centres at the grasp and at the release, (K, 3) float32."""

    picks: NDArray[np.float32]
    places: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.picks)

    def where(self, keep: NDArray[np.bool_]) -> "Candidates":
        return Candidates(self.picks[keep], self.places[keep])

    def __add__(self, other: "Candidates") -> "Candidates":
        return Candidates(np.concatenate([self.picks, other.picks]), np.concatenate([self.places, other.places]))


NOTHING = Candidates(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32))


def anywhere(points: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Accepts every point."""
    return np.ones(points.shape[:-1], np.bool_)


def sample(
    scene: "Scene", count: int, rng: np.random.Generator, *, reachable: Reachable, place_allowed: Test = anywhere
) -> Candidates:
    """Up to `count` candidates whose places are in view and allowed, and which the cell can carry out.

    Args:
        scene: the garment as seen.
        count: how many to look for; fewer come back only where hardly anything is in reach.
        rng: source of all randomness.
        reachable: asked once a round for all picks and places proposed.
        place_allowed: further condition on places.

    Raises:
        OutOfReach: not a single candidate was found.
        ReconstructionFailed: the mesh has no vertex that can be picked.
    """
    found = NOTHING
    for _ in range(ROUNDS):
        proposed = scene.propose(count - len(found), rng, place_allowed)
        found += proposed.where(reachable(proposed.picks, proposed.places))
        if len(found) == count:
            return found
    if not len(found):
        raise OutOfReach("no pick-and-place of the garment is in the arm's reach with its place in view")
    return found


@dataclass(frozen=True)
class Scene:
    """A garment's mesh and the view it was seen in."""

    mesh: ClothMesh
    view: DepthView

    @cached_property
    def camera(self) -> Camera:
        info = self.view.camera
        return Camera(info.K, info.T_world_camera, info.width, info.height)

    @cached_property
    def visible(self) -> NDArray[np.float32]:
        """(N, 3) vertices the camera sees [m]."""
        if not self.mesh.visible.any():
            raise ReconstructionFailed("the mesh has no visible vertex to pick")
        return self.mesh.vertices[self.mesh.visible]

    @cached_property
    def pickable(self) -> NDArray[np.float32]:
        """(P, 3) visible vertices over which the picker reaches cloth that was seen [m]."""
        nearest, _ = KDTree(self.seen).query(self.visible + ABOVE, distance_upper_bound=REACH_M)
        pickable = self.visible[np.isfinite(nearest)]
        if not len(pickable):
            raise ReconstructionFailed("the mesh lies beside the cloth that was seen: no vertex of it can be picked")
        return pickable

    @cached_property
    def seen(self) -> NDArray[np.float64]:
        """(Q, 3) what the camera measured in the box, of the cloth [m]; without a mask, of everything."""
        low, high = self.box
        boxed = self.measured[low[1] : high[1], low[0] : high[0]]
        return self.surface(np.argwhere(boxed)[:, ::-1] + low)

    @cached_property
    def measured(self) -> NDArray[np.bool_]:
        """(H, W) pixels with a depth, on the cloth where there is a mask."""
        deep = (self.view.depth > 0) & np.isfinite(self.view.depth)
        return deep if self.view.mask is None else deep & self.view.mask

    @cached_property
    def _nearest_pickable(self) -> KDTree:
        return KDTree(self.pickable)

    @cached_property
    def box(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First and one past the last pixel (u, v) of the bounding box of all vertices, margin added, in the image."""
        uv, _ = self.camera.project(self.mesh.vertices)
        size = np.array([self.camera.width, self.camera.height])
        margin = MARGIN * self.camera.width
        low = np.clip(np.floor(np.nanmin(uv, axis=0) - margin), 0, size).astype(np.int64)
        high = np.clip(np.ceil(np.nanmax(uv, axis=0) + margin), 0, size).astype(np.int64)
        if (low >= high).any():
            raise NoGarment("the garment lies outside the image")
        return low, high

    def propose(self, count: int, rng: np.random.Generator, place_allowed: Test) -> Candidates:
        """At most `count` candidates, reach not yet asked for."""
        low, high = self.box
        picks = self.snap(self.surface(rng.integers(low, high, size=(count, 2))))
        places = picks[:, None] + pulls(count, DIRECTIONS_PER_PICK, rng)
        fits = self.camera.contains(places) & place_allowed(places)
        first = fits.argmax(axis=1)
        every = np.arange(count)
        return Candidates(picks, places[every, first]).where(fits[every, first])

    def snap(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """Picker centres over the pickable vertices nearest to points (N, 3)."""
        _, nearest = self._nearest_pickable.query(points)
        return self.pickable[nearest] + ABOVE

    def surface(self, pixels: NDArray[np.int64]) -> NDArray[np.float64]:
        """World points (N, 3) [m] seen at pixels (N, 2) = (u, v): on the cloth, or 5 mm over the table beside it."""
        camera = self.camera
        columns, rows = pixels.T
        rays = np.c_[pixels + 0.5, np.ones(len(pixels))] @ (camera.T_world_camera[:3, :3] @ camera.K_inverse).T
        depth = self.view.depth[rows, columns]
        to_table = (SURFACE_HEIGHT_M - camera.position[2]) / rays[:, 2]
        return camera.position + rays * np.where(self.measured[rows, columns], depth, to_table)[:, None]


def pulls(count: int, tries: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """(count, tries, 3) displacements from pick to place [m]: random heading, never downwards, 5 to 20 cm long."""
    direction = rng.uniform((-0.5, -0.5, 0.0), 0.5, size=(count, tries, 3))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return (direction * rng.uniform(*LENGTHS_M, size=(count, tries, 1))).astype(np.float32)
