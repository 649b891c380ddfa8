"""From a message's camera to a camera that can be trusted to look at the table."""

import numpy as np

from medor_cloth.camera import Camera
from medor_wire.errors import BadRequest
from medor_wire.messages import CameraInfo

MIN_DOWNWARD = 0.5
"""Least cosine between the optical axis and straight down: 60 degrees."""


def viewpoint(info: CameraInfo) -> Camera:
    """The camera of a view.

    Raises:
        BadRequest: not a pinhole camera, not a rigid pose, or not a look at the table plane z = 0 from above.
    """
    K, T = info.K, info.T_world_camera
    if min(K[0, 0], K[1, 1]) <= 0 or not np.allclose(K[2], [0, 0, 1]):
        raise BadRequest(f"camera.K: expected pinhole intrinsics with positive focal lengths, got {K.tolist()}")
    R = T[:3, :3]
    if not (np.allclose(R @ R.T, np.eye(3), atol=1e-4) and np.linalg.det(R) > 0 and np.allclose(T[3], [0, 0, 0, 1])):
        raise BadRequest(f"camera.T_world_camera: expected a rotation and a translation, got {T.tolist()}")
    if T[2, 3] <= 0 or -R[2, 2] < MIN_DOWNWARD:
        raise BadRequest(
            "camera.T_world_camera: expected a camera above the table (z > 0) whose optical axis is within 60 degrees "
            f"of straight down, got height {T[2, 3]:.3f} m and axis {R[:, 2].round(3).tolist()}"
        )
    return Camera(K, T, info.width, info.height)
