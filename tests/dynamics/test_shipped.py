"""The weights that come with the package, on a category and garments that they were not taught with."""

import numpy as np
import pytest
import torch

from medor_cloth.garment import generate
from medor_cloth.goals import solver_of
from medor_cloth.picker import GLANCE_FRAMES
from medor_cloth.start import dropped
from medor_dynamics.learned import Learned, learned
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.physics import Physics
from medor_dynamics.shipped import DEFAULT
from medor_wire.bus import Call
from medor_wire.messages import ClothMesh, Reward, RolloutRequest


@pytest.fixture(scope="module")
def shirt() -> ClothMesh:
    garment = generate("tshirt", 860_001)
    solver = solver_of(garment)
    vertices = dropped(solver, solver.rest(garment.laid_flat()), np.random.default_rng(1)).positions
    return ClothMesh(
        vertices=vertices,
        faces=garment.faces,
        category="tshirt",
        visible=np.ones(len(vertices), bool),
        canonical=garment.vertices,
        panel_uv=garment.panel_uv,
    )


def test_it_foresees_pulls_at_a_shirt_far_better_than_nothing(shirt):
    rng = np.random.default_rng(0)
    picks = shirt.vertices[rng.choice(len(shirt.vertices), 8)] + np.array([0, 0, 0.005], np.float32)
    angles = rng.uniform(0, 2 * np.pi, 8)
    ways = rng.uniform(0.1, 0.3, 8)[:, None] * np.stack([np.cos(angles), np.sin(angles), np.full(8, 0.2)], 1)
    places = (picks + ways).astype(np.float32)
    asked = RolloutRequest(mesh=shirt, picks=picks, places=places, reward=Reward(task="flatten"))
    model = learned(DEFAULT, 1, torch.float32)
    assert isinstance(model, Learned), "there are weights"
    nodes = NodeMesh.of(shirt).ids
    truth = Physics(2, settle_frames=GLANCE_FRAMES)
    true, foreseen = (backend.roll_out(asked, Call()).positions[:, nodes] for backend in (truth, model))
    error = np.linalg.norm(foreseen - true, axis=-1).mean()
    assert error < 0.5 * np.linalg.norm(true - shirt.vertices[nodes], axis=-1).mean()


def test_the_card_says_how_they_came_about():
    text = (DEFAULT / "card.md").read_text()
    assert all(heading in text for heading in ("## command", "## data", "## metrics", "## revision"))
