"""Pinhole depth camera: between metres in the world frame and pixels.

Camera frame: x right, y down, z forward (OpenCV). Pixel (row i, column j) has its centre at
(u, v) = (j + 0.5, i + 0.5). Depth is the z coordinate in the camera frame [m]; 0 means nothing was measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

HEIGHT_M = 0.65
"""Height of the overhead camera above the table (MEDOR, section IV)."""
FIELD_OF_VIEW_DEG = 45.0
"""Full opening angle of the overhead camera: 0.538 m of table."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics and pose of a pinhole camera.

    Attributes:
        K: (3, 3) float64 intrinsics [px].
        T_world_camera: (4, 4) float64 pose, `p_world = T_world_camera @ p_camera` [m].
        width: image columns.
        height: image rows.
    """

    K: np.ndarray
    T_world_camera: np.ndarray
    width: int
    height: int

    def __post_init__(self) -> None:
        for name, shape in (("K", (3, 3)), ("T_world_camera", (4, 4))):
            matrix = np.array(getattr(self, name), np.float64)
            if matrix.shape != shape or not np.isfinite(matrix).all():
                raise ValueError(f"{name}: expected a finite matrix of shape {shape}, got shape {matrix.shape}")
            matrix.setflags(write=False)
            object.__setattr__(self, name, matrix)
        if self.width < 1 or self.height < 1:
            raise ValueError(f"expected a positive image size, got {self.width} x {self.height}")

    @cached_property
    def T_camera_world(self) -> np.ndarray:
        """(4, 4) float64 inverse of `T_world_camera`."""
        return np.linalg.inv(self.T_world_camera)

    @cached_property
    def K_inverse(self) -> np.ndarray:
        """(3, 3) float64; `K_inverse @ (u, v, 1)` is the camera-frame ray of unit depth."""
        return np.linalg.inv(self.K)

    @property
    def position(self) -> np.ndarray:
        """(3,) float64 optical centre in the world frame [m]."""
        return self.T_world_camera[:3, 3]

    def to_camera(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) [m] in the camera frame, float64."""
        return np.asarray(points, np.float64) @ self.T_camera_world[:3, :3].T + self.T_camera_world[:3, 3]

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixel coordinates (..., 2) = (u, v) and depth (...) [m] of world points (..., 3).

        Points in the camera plane or behind it have no image: their (u, v) is NaN.
        """
        points_camera = self.to_camera(points)
        depth = points_camera[..., 2]
        ahead = np.where(depth > 0, depth, np.nan)
        return (points_camera @ self.K.T)[..., :2] / ahead[..., None], depth

    def rays(self) -> np.ndarray:
        """(H, W, 3) float64 world directions through the pixel centres, of unit depth (not unit length)."""
        u, v = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        pixels = np.stack([u, v, np.ones_like(u)], axis=-1)
        return pixels @ (self.T_world_camera[:3, :3] @ self.K_inverse).T

    def back_project(self, depth: np.ndarray) -> np.ndarray:
        """World points (H, W, 3) float32 [m] seen at depth (H, W) [m]; NaN where nothing was measured (0)."""
        if depth.shape != (self.height, self.width):
            raise ValueError(f"expected a depth image of {(self.height, self.width)}, got {depth.shape}")
        measured = np.where(depth > 0, depth, np.nan)
        return (self.position + self.rays() * measured[..., None]).astype(np.float32)

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(...) bool: world points (..., 3) in front of the camera whose projection lies inside the image."""
        uv, _ = self.project(points)
        return np.all((uv >= 0) & (uv < (self.width, self.height)), axis=-1)

    def resized(self, width: int, height: int) -> Camera:
        """The same view sampled by another number of pixels."""
        scale = np.diag([width / self.width, height / self.height, 1.0])
        return Camera(scale @ self.K, self.T_world_camera, width, height)


def overhead(width: int = 720) -> Camera:
    """The square camera above the origin, looking straight down: image right = world +x, image up = +y."""
    focal = width / (2 * np.tan(np.radians(FIELD_OF_VIEW_DEG / 2)))
    K = np.array([[focal, 0, width / 2], [0, focal, width / 2], [0, 0, 1]])
    T_world_camera = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, HEIGHT_M], [0, 0, 0, 1]])
    return Camera(K, T_world_camera, width, width)
