"""Compile everything a rollout needs before the first one is asked for."""

from contextlib import suppress

import numpy as np

from medor_dynamics.roller import Roller
from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh, Reward, RolloutRequest

EDGE_M = 0.012


def warm_up(roller: Roller) -> None:
    """Rolls one pick-and-place out on a small patch with every backend that is ready to."""
    mesh = patch()
    pick = mesh.vertices[:1]
    for backend in roller.names:
        request = RolloutRequest(
            mesh=mesh, picks=pick, places=pick + np.float32(EDGE_M), reward=Reward(task="flatten"), backend=backend
        )
        with suppress(BadRequest):  # a backend without weights says so when it is asked
            roller.roll_out(request, Call())


def patch() -> ClothMesh:
    """A patch of eight triangles."""
    x, y = np.meshgrid(np.arange(3) * EDGE_M, np.arange(3) * EDGE_M, indexing="ij")
    vertices = np.stack([x, y, np.full_like(x, EDGE_M)], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = np.array([0, 1, 3, 4])
    faces = np.concatenate([[[c, c + 3, c + 4], [c, c + 4, c + 1]] for c in corner]).astype(np.int32)
    return ClothMesh(vertices=vertices, faces=faces, category="tshirt", visible=np.ones(len(vertices), bool))
