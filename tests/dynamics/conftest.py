"""Small pieces of cloth: as messages, as recordings of what the solver does to them, as graphs."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import zarr

from medor_cloth.camera import overhead
from medor_cloth.cloth import Cloth
from medor_cloth.dataset import FORMAT, STORED
from medor_cloth.picker import pick_place
from medor_cloth.raster import visible_vertices
from medor_cloth.solver import Solver
from medor_dynamics.frame import headings, turned
from medor_dynamics.model import Dynamics
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.preset import CPU, PULL_STEPS, STEPS, Preset
from medor_dynamics.samples import Recording
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


@pytest.fixture
def write_shard() -> Callable[..., None]:
    return written_shard


def written_shard(folder: Path, mesh: ClothMesh, frames: np.ndarray, move: np.ndarray, nodes: NodeMesh) -> None:
    """One trajectory as `medor_sim.collect` writes it."""
    plan = {"kind": "dynamics", "split": "train", "seed": 0}
    shard = zarr.open_group(folder / "shard.zarr", mode="w", attributes={"format": FORMAT, "plan": plan})
    group = shard.create_group("garment-000000", attributes={"category": "tshirt", "seed": 1, "first": 0})
    arrays = {
        "vertices": mesh.vertices,
        "faces": mesh.faces,
        "panel_uv": mesh.panel_uv,
        "node_ids": nodes.ids,
        "node_edges": nodes.edges,
        "complete": np.array([True]),
        "positions": STORED["positions"].store(frames)[None],
        "visible": np.ones((1, len(nodes.ids)), bool),
        "move": move[None],
        "grasp": np.array([[nodes.node_of(0), 0]], np.int32),
    }
    for name, values in arrays.items():
        group.create_array(name, data=np.ascontiguousarray(values))


@pytest.fixture(scope="session")
def folded() -> Recording:
    """A corner of a sheet pulled over the rest of it by the cloth solver, seen at every model step."""
    return recording_of(sheet_mesh(side=0.15), np.array([0.12, 0.1, 0.05], np.float32))


def recording_of(mesh: ClothMesh, pull: np.ndarray) -> Recording:
    solver = Solver(Cloth.from_mesh(mesh.vertices, mesh.faces))
    pick = mesh.vertices[0] + np.array([0, 0, 0.01], np.float32)
    frames = pick_place(solver, solver.rest(mesh.vertices), pick, pick + pull, record_every=5).frames
    frames = np.concatenate([mesh.vertices[None], frames, np.repeat(frames[-1:], STEPS, axis=0)])[: STEPS + 1]
    nodes = NodeMesh.of(mesh)
    along = -headings(pull[None], CPU)
    return Recording(
        category=mesh.category,
        positions=turned(frames[:, nodes.ids], along),
        edges=nodes.edges,
        rest=nodes.rest_lengths(mesh.vertices[nodes.ids], CPU),
        node=nodes.node_of(0),
        step=turned(pull[None] / PULL_STEPS, along)[0, 0],
    )


SMALL = replace(CPU, width=16, blocks=2, normalize=False)
"""Everything the preset does, at a size for tests."""


@pytest.fixture
def model() -> Callable[..., Dynamics]:
    def make(preset: Preset = SMALL, *, seed: int = 0) -> Dynamics:
        torch.manual_seed(seed)
        return Dynamics(preset).eval()

    return make


@pytest.fixture
def crumpled() -> np.ndarray:
    """(n, 3) nodes in several layers [m]."""
    return np.random.default_rng(5).uniform((-0.08, -0.08, 0), (0.08, 0.08, 0.04), (60, 3)).astype(np.float32)
