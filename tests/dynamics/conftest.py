"""Small pieces of cloth as messages."""

from collections.abc import Callable

import numpy as np
import pytest

from medor_cloth.camera import overhead
from medor_cloth.raster import visible_vertices
from medor_wire.messages import ClothMesh, Reward, RolloutRequest


@pytest.fixture
def sheet() -> Callable[..., ClothMesh]:
    return sheet_mesh


def sheet_mesh(*, side: float = 0.12, edge: float = 0.012, height: float = 0.0025, panels: bool = False) -> ClothMesh:
    """A square sheet on the table, at rest."""
    n = round(side / edge) + 1
    x, y = np.meshgrid(*[np.linspace(-side / 2, side / 2, n)] * 2, indexing="ij")
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    a, b, c, d = corner, corner + n, corner + n + 1, corner + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    vertices = np.stack([x, y, np.full_like(x, height)], -1).reshape(-1, 3).astype(np.float32)
    return ClothMesh(
        vertices=vertices,
        faces=faces,
        category="tshirt",
        visible=visible_vertices(vertices, faces, overhead(240)),
        panel_uv=vertices[faces][..., :2] if panels else None,
    )


@pytest.fixture
def request_for() -> Callable[..., RolloutRequest]:
    def make(mesh: ClothMesh, picks, places, reward: Reward | None = None) -> RolloutRequest:
        return RolloutRequest(
            mesh=mesh,
            picks=np.asarray(picks, np.float32),
            places=np.asarray(places, np.float32),
            reward=reward or Reward(task="flatten"),
        )

    return make
