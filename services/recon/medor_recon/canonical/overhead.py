"""Any camera's view as the overhead camera of the training data would have it."""

import numpy as np
from numpy.typing import NDArray

from medor_cloth.camera import Camera, overhead
from medor_recon.canonical.views import SIDE_PX

CAMERA = overhead(SIDE_PX)


def overhead_depth(depth: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """(SIDE_PX, SIDE_PX) depth [m] of the overhead camera, 0 where nothing is seen.

    Of that very camera at another resolution the nearest pixels are taken. What another one sees is projected, the
    highest point counts.

    Args:
        depth: (H, W) [m], 0 off the cloth.
        camera: which took it.
    """
    if _same_view(camera):
        rows = ((np.arange(SIDE_PX) + 0.5) * camera.height / SIDE_PX).astype(int)
        columns = ((np.arange(SIDE_PX) + 0.5) * camera.width / SIDE_PX).astype(int)
        return depth[np.ix_(rows, columns)].astype(np.float32)
    points = camera.back_project(depth)[depth > 0]
    points = points[CAMERA.contains(points)]
    uv, z = CAMERA.project(points)
    nearest = np.full((SIDE_PX, SIDE_PX), np.inf, np.float32)
    columns, rows = uv.astype(int).T
    np.minimum.at(nearest, (rows, columns), z.astype(np.float32))
    return np.where(np.isfinite(nearest), nearest, 0)


def _same_view(camera: Camera) -> bool:
    resized = camera.resized(SIDE_PX, SIDE_PX)
    same_K = np.allclose(resized.K, CAMERA.K, rtol=1e-3, atol=0.1)
    return same_K and np.allclose(camera.T_world_camera, CAMERA.T_world_camera, atol=1e-4)
