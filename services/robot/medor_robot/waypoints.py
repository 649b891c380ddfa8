"""A pick-and-place as the stations an arm passes: the flying picker's pull, with a way in and out."""

from typing import NamedTuple

import numpy as np

from medor_cloth.picker import pull

CLEARANCE_M = 0.10
"""The tool comes and leaves this high above its goal, so as not to push cloth away."""
PULL_STRIDE = 10


class Waypoint(NamedTuple):
    point: np.ndarray
    """(3,) world frame [m]."""
    closed: bool
    """Gripper on arrival."""


def waypoints(pick: np.ndarray, place: np.ndarray) -> list[Waypoint]:
    """Above the pick, down, grip, along the straight pull, release, up."""
    up = np.array([0, 0, CLEARANCE_M])
    pulled = pull(pick, place)[PULL_STRIDE - 1 :: PULL_STRIDE]
    return [
        Waypoint(pick + up, False),
        Waypoint(pick, False),
        Waypoint(pick, True),
        *(Waypoint(point, True) for point in pulled),
        Waypoint(place, False),
        Waypoint(place + up, False),
    ]
