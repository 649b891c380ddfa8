"""Views of analytic sheets of cloth, rendered by the same rasteriser as the simulator's."""

from collections.abc import Callable

import numpy as np
import pytest

from medor_cloth.camera import Camera, overhead
from medor_cloth.raster import rasterize
from medor_wire.messages import CameraInfo, DepthView

Height = Callable[[np.ndarray, np.ndarray], np.ndarray]
Sheet = tuple[np.ndarray, np.ndarray]


@pytest.fixture
def camera() -> Camera:
    return overhead(360)


@pytest.fixture
def sheet() -> Callable[..., Sheet]:
    return grid_sheet


@pytest.fixture
def view(camera: Camera) -> Callable[..., DepthView]:
    def take(*sheets: Sheet, masked: bool = True, noise: float = 0.0, table: bool = False) -> DepthView:
        starts = np.cumsum([0, *(len(v) for v, _ in sheets)])
        vertices = np.concatenate([v for v, _ in sheets])
        faces = np.concatenate([f + start for (_, f), start in zip(sheets, starts, strict=False)])
        raster = rasterize(vertices, faces, camera)
        depth = np.where(raster.mask | (not table), raster.depth, camera.position[2])
        depth = depth + noise * np.random.default_rng(0).standard_normal(depth.shape) * (depth > 0)
        return DepthView(
            depth=depth.astype(np.float32), camera=message_of(camera), mask=raster.mask if masked else None
        )

    return take


def message_of(camera: Camera) -> CameraInfo:
    return CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=camera.width, height=camera.height)


def grid_sheet(
    width: float = 0.2, length: float = 0.2, centre: tuple[float, float] = (0, 0), height: Height | float = 0.005
) -> Sheet:
    """A rectangle of 5 mm quads whose height is a function of (x, y)."""
    nx, ny = round(width / 0.005) + 1, round(length / 0.005) + 1
    x, y = np.meshgrid(np.linspace(-width / 2, width / 2, nx), np.linspace(-length / 2, length / 2, ny), indexing="ij")
    x, y = x + centre[0], y + centre[1]
    z = height(x, y) if callable(height) else np.full_like(x, height)
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    a, b, c, d = corner, corner + ny, corner + ny + 1, corner + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    return np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), faces
