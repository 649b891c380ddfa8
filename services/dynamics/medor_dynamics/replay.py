"""Recorded pulls done again by a backend: how far from the recording do they end?"""

from collections.abc import Iterable, Iterator
from typing import cast

import numpy as np

from medor_cloth.dataset import GarmentRecord, Trajectory
from medor_dynamics.roller import Backend
from medor_wire.bus import Call
from medor_wire.messages import Category, ClothMesh, Reward, RolloutRequest


def replay_errors(backend: Backend, records: Iterable[GarmentRecord]) -> Iterator[float]:
    """Mean distance [m] of the nodes from where each recording ends. Backends know the whole mesh, at rest as sewn."""
    for record in records:
        nodes = record["node_ids"]
        for trajectory in record.trajectories():
            end = backend.roll_out(request_of(trajectory), Call()).positions[0]
            yield float(np.linalg.norm((end - trajectory["positions"][-1])[nodes], axis=1).mean())


def request_of(trajectory: Trajectory) -> RolloutRequest:
    """The pull of a trajectory, from where the cloth lay before it."""
    garment, start = trajectory.garment, trajectory["positions"][0]
    pick, place = trajectory["move"].astype(np.float32)
    mesh = ClothMesh(
        vertices=start,
        faces=garment["faces"],
        category=cast(Category, garment.category),
        visible=np.ones(len(start), bool),
        canonical=garment["vertices"],
        panel_uv=garment["panel_uv"],
    )
    return RolloutRequest(mesh=mesh, picks=pick[None], places=place[None], reward=Reward(task="flatten"))
