"""Sheets of cloth under the overhead camera, and a cell with a real solver but without a robot."""

from collections.abc import Callable

import numpy as np
import pytest

from medor_cloth.camera import Camera, overhead
from medor_cloth.raster import rasterize, visible_vertices
from medor_planner.sampling import Scene
from medor_wire.messages import CameraInfo, ClothMesh, DepthView


@pytest.fixture
def camera() -> Camera:
    return overhead(240)


@pytest.fixture
def sheet_scene(camera: Camera) -> Callable[..., Scene]:
    def make(*, folded: bool = False, centre: tuple[float, float] = (0.0, 0.0)) -> Scene:
        vertices, faces = sheet(0.2, 0.24)
        if folded:
            over = vertices[:, 0] > 0.034
            vertices[over] = vertices[over] * [-1, 1, 1] + [0.068, 0, 0.006]
        return seen((vertices + [*centre, 0]).astype(np.float32), faces, camera)

    return make


def sheet(width: float, length: float, edge: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """A rectangle of triangles lying 5 mm over the table, centred on the origin."""
    nx, ny = round(width / edge) + 1, round(length / edge) + 1
    x, y = np.meshgrid(np.linspace(-width / 2, width / 2, nx), np.linspace(-length / 2, length / 2, ny), indexing="ij")
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    a, b, c, d = corner, corner + ny, corner + ny + 1, corner + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    return np.stack([x, y, np.full_like(x, 0.005)], -1).reshape(-1, 3), faces


def seen(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> Scene:
    """A mesh and its depth image."""
    mesh = ClothMesh(
        vertices=vertices, faces=faces, category="tshirt", visible=visible_vertices(vertices, faces, camera)
    )
    return Scene(mesh, view_of(vertices, faces, camera))


def view_of(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> DepthView:
    info = CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=camera.width, height=camera.height)
    return DepthView(depth=rasterize(vertices, faces, camera).depth, camera=info)
