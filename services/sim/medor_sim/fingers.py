"""Fingers push cloth: vertices inside the hand or a finger are put out of it, between two frames of the cloth.

A deliberately plain contact: three boxes, no friction. What is pressed onto the table stays between finger and table.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from medor_cloth.integration import FRAME_S
from medor_cloth.solver import ClothState
from medor_sim.kinematics import Poses

LAYER_M = 0.0025
"""Half of a layer of cloth: boxes are thicker by it, and no vertex is pushed nearer to the table [m]."""
FINGER_HALF_M = np.array([0.0095, 0.00725, 0.0186])
FINGER_ALONG_M = -0.0114
"""A finger's half sizes (outwards, across, along the tool) and where its middle is along the tool [m]."""
HAND_HALF_M = np.array([0.0316, 0.102, 0.048])
HAND_ALONG_M = -0.083


class Box(NamedTuple):
    """A box about a centre (3,) with half sizes (3,), in axes that are the columns of a rotation (3,3); moving."""

    centre: NDArray[np.float64]
    half: NDArray[np.float64]
    axes: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True)
class Fingers:
    """The hand along a motion.

    Attributes:
        poses: Of the tool at the end of each frame (T,).
        openings: (T,) half of the gap between the fingers [m].
    """

    poses: Poses
    openings: NDArray[np.float64]

    def boxes(self, frame: int) -> list[Box]:
        """Both fingers and the hand at the end of a frame."""
        now, before = frame, max(frame - 1, 0)
        tool, axes = self.poses.points[now], self.poses.rotations[now]
        velocity = (tool - self.poses.points[before]) / FRAME_S
        opening = (self.openings[now] - self.openings[before]) / FRAME_S * axes[:, 1]
        out = self.openings[now] + FINGER_HALF_M[1]
        fingers = [
            Box(tool + axes @ (0, side * out, FINGER_ALONG_M), FINGER_HALF_M, axes, velocity + side * opening)
            for side in (-1, 1)
        ]
        return [*fingers, Box(tool + axes @ (0, 0, HAND_ALONG_M), HAND_HALF_M, axes, velocity)]

    def touch(self, frame: int, positions: NDArray[np.float32]) -> bool:
        """Whether any vertex (V,3) [m] is inside at the end of a frame."""
        return any(_inside(box, positions)[1].any() for box in self.boxes(frame))

    def push(self, frame: int, cloth: ClothState) -> ClothState:
        """The cloth with what is inside put out where the way is shortest, never towards the wrist.

        A held vertex is left where it is: it is between the fingers.
        """
        if not self.touch(frame, cloth.positions):
            return cloth
        positions, velocities = cloth.positions.copy(), cloth.velocities.copy()
        for box in self.boxes(frame):
            _put_out(box, positions, velocities, cloth.held)
        return replace(cloth, positions=positions, velocities=velocities)


def _inside(box: Box, positions: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Positions in the box's axes (V,3), and which are inside (V,)."""
    local = (positions - box.centre) @ box.axes
    return local, np.all(np.abs(local) < box.half + LAYER_M, axis=1)


def _put_out(box: Box, positions: NDArray[np.float32], velocities: NDArray[np.float32], held: int) -> None:
    local, inside = _inside(box, positions)
    if held >= 0:
        inside[held] = False
    which = np.flatnonzero(inside)
    side = np.where(local[which] < 0, -1.0, 1.0)
    side[:, 2] = 1.0
    depth = box.half + LAYER_M - side * local[which]
    axis = depth.argmin(axis=1)
    every = np.arange(len(which))
    outwards = box.axes.T[axis] * side[every, axis, None]
    positions[which] += depth[every, axis, None] * outwards
    positions[which, 2] = np.maximum(positions[which, 2], LAYER_M)
    into = ((velocities[which] - box.velocity) * outwards).sum(axis=1)
    velocities[which] -= np.minimum(into, 0)[:, None] * outwards
