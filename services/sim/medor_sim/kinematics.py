"""The Panda with its elbow in a vertical plane: where its tool is, and which joints bring it there, in closed form.

Joint 1 turns that plane about the base axis; joints 3 and 5 stay 0; joints 2, 4 and 6 are a planar arm of three
links, which three numbers determine: distance from the base axis, height and lean of the tool. Joint 7 stays where the
fingers open across the plane. A point therefore always has the same posture: no branches, nothing to iterate.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

N_JOINTS = 7
LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
"""Joint limits [rad], as Franka Robotics states them."""
SHOULDER_M = 0.333
UPPER_ARM_M, FOREARM_M, ELBOW_M = 0.316, 0.384, 0.0825
WRIST_M, TOOL_M = 0.088, 0.107 + 0.105
"""From the axis of joint 6 outwards, then along the tool to the point between the fingers."""
NEAREST_M = 0.15
"""Nearer to its axis than this the arm does not work: the tool would lean into its own foot."""
ACROSS = np.pi / 4
"""Joint 7 [rad] with the fingers opening across the arm's plane."""
UPRIGHT_M, LEANING = 0.55, 12.0
"""The tool points straight down this far from the base axis; see `lean`."""


class Postures(NamedTuple):
    """Joint angles (N,7) [rad], NaN where a point is too far, and whether they keep within the limits (N,)."""

    joints: NDArray[np.float64]
    within: NDArray[np.bool_]


class Poses(NamedTuple):
    """Tool points (N,3) [m] and orientations (N,3,3): columns outwards, across (the fingers' way), out of the hand."""

    points: NDArray[np.float64]
    rotations: NDArray[np.float64]


def lean(radius: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle of the tool from straight down, outwards [rad], by distance from the base axis [m].

    As a person's hand it leans outwards far away and inwards near by, or the table's corners would be out of reach. A
    cubic is smooth, so that a straight path has smooth joints.
    """
    return LEANING * (np.asarray(radius) - UPRIGHT_M) ** 3


def solve(points: NDArray, base: NDArray, margin: float = 0.0) -> Postures:
    """The postures with the tool at points (N,3) [m], base at (3,), both in the world frame.

    Args:
        points: Where the tool should be.
        base: Foot of the arm.
        margin: Distance kept from the joint limits [rad].
    """
    offset = np.asarray(points, np.float64) - base
    radius = np.hypot(offset[:, 0], offset[:, 1])
    tilt = lean(radius)
    outwards, upwards = np.sin(tilt), np.cos(tilt)
    x = radius - TOOL_M * outwards - WRIST_M * upwards
    z = offset[:, 2] + TOOL_M * upwards - WRIST_M * outwards - SHOULDER_M
    upper, fore, reach = np.hypot(UPPER_ARM_M, ELBOW_M), np.hypot(FOREARM_M, ELBOW_M), np.hypot(x, z)
    with np.errstate(invalid="ignore", divide="ignore"):
        elbow = np.arccos((upper**2 + fore**2 - reach**2) / (2 * upper * fore))
        shoulder = np.arccos((upper**2 + reach**2 - fore**2) / (2 * upper * reach))
    second = np.arctan2(x, z) - shoulder - np.arctan2(ELBOW_M, UPPER_ARM_M)
    fourth = elbow + np.arctan2(UPPER_ARM_M, ELBOW_M) + np.arctan2(FOREARM_M, ELBOW_M) - 2 * np.pi
    joints = np.zeros((len(offset), N_JOINTS))
    joints[:, 0] = np.arctan2(offset[:, 1], offset[:, 0])
    joints[:, 1], joints[:, 3], joints[:, 5], joints[:, 6] = second, fourth, tilt + second - fourth, ACROSS
    within = np.all((joints >= LOWER + margin) & (joints <= UPPER - margin), axis=1)
    return Postures(joints, within & (radius >= NEAREST_M))


def forward(joints: NDArray, base: NDArray) -> Poses:
    """Where postures (N,7) [rad] of this family put the tool; base at (3,) [m]."""
    heading, second, fourth = joints[:, 0], joints[:, 1], joints[:, 3]
    tilt = joints[:, 5] - second + fourth
    below = second - fourth
    radius = (
        UPPER_ARM_M * np.sin(second)
        + ELBOW_M * (np.cos(second) - np.cos(below))
        + FOREARM_M * np.sin(below)
        + WRIST_M * np.cos(tilt)
        + TOOL_M * np.sin(tilt)
    )
    height = (
        SHOULDER_M
        + UPPER_ARM_M * np.cos(second)
        - ELBOW_M * (np.sin(second) - np.sin(below))
        + FOREARM_M * np.cos(below)
        + WRIST_M * np.sin(tilt)
        - TOOL_M * np.cos(tilt)
    )
    ahead = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
    aside = np.stack([np.sin(heading), -np.cos(heading), np.zeros_like(heading)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    sine, cosine = np.sin(tilt)[:, None], np.cos(tilt)[:, None]
    points = base + radius[:, None] * ahead + height[:, None] * up
    return Poses(points, np.stack([cosine * ahead + sine * up, aside, sine * ahead - cosine * up], axis=2))
