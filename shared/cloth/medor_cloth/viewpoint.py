"""Where to look at cloth from."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import HEIGHT_M, Camera, overhead

FIELD_OF_VIEW_DEG = 30.0
AZIMUTH_DEG = -65.0
ROOM = 1.08
"""Distance of a fitted camera over the smallest that shows everything."""


def above(points: NDArray, width: int) -> Camera:
    """The cell's own camera; risen, over their middle, when it does not see all points (..., 3) [m]."""
    usual = overhead(width)
    if usual.contains(points).all():
        return usual
    return _fitted(points, usual.T_world_camera[:3, :3], usual.K, width)


def turns(points: NDArray, width: int, count: int, elevation_deg: float) -> list[Camera]:
    """Views of points (..., 3) [m] all the way around them, all from one distance and height."""
    points = np.asarray(points, np.float64).reshape(-1, 3)
    middle = (points.max(0) + points.min(0)) / 2
    reach = np.linalg.norm(points[:, :2] - middle[:2], axis=1).max()
    angles = np.radians(np.arange(0, 360, 10))
    rim = middle[:2] + reach * np.stack([np.cos(angles), np.sin(angles)], 1)
    can = np.concatenate(
        [np.column_stack([rim, np.full(len(rim), z)]) for z in (points[:, 2].min(), points[:, 2].max())]
    )
    return [around(can, width, elevation_deg, AZIMUTH_DEG + 360 * k / count) for k in range(count)]


def around(points: NDArray, width: int, elevation_deg: float = 38.0, azimuth_deg: float = AZIMUTH_DEG) -> Camera:
    """A square perspective view of all points (..., 3) [m] from the side.

    Args:
        points: What to see, world frame.
        width: Of the picture [px].
        elevation_deg: Height of the camera over the horizon.
        azimuth_deg: Direction to the camera in the table plane; 0 is +x, -90 in front of a garment (-y).
    """
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    forward = -np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    focal = width / (2 * np.tan(np.radians(FIELD_OF_VIEW_DEG / 2)))
    K = np.array([[focal, 0, width / 2], [0, focal, width / 2], [0, 0, 1]])
    return _fitted(points, rotation, K, width)


def _fitted(points: NDArray, rotation: NDArray, K: NDArray, width: int) -> Camera:
    """The camera of an orientation (3, 3) that just sees all points, their middle in the middle."""
    points = np.asarray(points, np.float64).reshape(-1, 3)
    middle = (points.max(0) + points.min(0)) / 2
    seen = (points - middle) @ rotation
    half = width / (2 * K[0, 0])
    distance = float((np.abs(seen[:, :2]).max(1) / half - seen[:, 2]).max())
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = middle - ROOM * max(distance, HEIGHT_M / 10) * rotation[:, 2]
    return Camera(K, pose, width, width)
