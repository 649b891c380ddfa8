import numpy as np
import pytest
from scipy.stats import rankdata

from medor_dynamics.coarse import Coarse
from medor_dynamics.physics import Physics
from medor_dynamics.rewards import DIVERGED_PENALTY
from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh

ABOVE = np.array([0, 0, 0.01], np.float32)


def pulls_at_random(mesh: ClothMesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    picks = mesh.vertices[rng.integers(len(mesh.vertices), size=count)] + ABOVE
    angles = rng.uniform(0, 2 * np.pi, count)
    reach = rng.uniform(0.03, 0.15, count)[:, None]
    level = np.stack([np.cos(angles), np.sin(angles), np.full(count, 0.5)], axis=1)
    return picks, (picks + reach * level).astype(np.float32)


def test_it_ranks_pulls_as_the_cloth_solver_does(sheet, request_for):
    mesh = sheet(side=0.2)
    asked = request_for(mesh, *pulls_at_random(mesh, 40))
    rough, exact = (backend(threads=2).roll_out(asked, Call()).rewards for backend in (Coarse, Physics))
    assert np.corrcoef(rankdata(rough), rankdata(exact))[0, 1] > 0.8, "Spearman correlation"


def test_a_rollout_depends_neither_on_threads_nor_on_the_other_candidates(sheet, request_for):
    mesh = sheet()
    picks, places = pulls_at_random(mesh, 9)
    all_nine = Coarse(threads=2).roll_out(request_for(mesh, picks, places), Call())
    fifth = Coarse(threads=1).roll_out(request_for(mesh, picks[4:5], places[4:5]), Call())
    np.testing.assert_array_equal(all_nine.positions[4], fifth.positions[0])
    assert all_nine.rewards[4] == fifth.rewards[0]


def test_a_piece_smaller_than_a_node_stays_with_its_node(sheet, request_for):
    low = sheet(side=0.1)
    lone = np.array([[0.20, 0.2, 0.02], [0.21, 0.2, 0.02], [0.2, 0.21, 0.02]], np.float32)
    mesh = ClothMesh(
        vertices=np.concatenate([low.vertices, lone]),
        faces=np.concatenate([low.faces, np.arange(3, dtype=np.int32)[None] + len(low.vertices)]),
        category="tshirt",
        visible=np.ones(len(low.vertices) + 3, bool),
    )
    pick = low.vertices[:1] + ABOVE
    rolled = Coarse(threads=1).roll_out(request_for(mesh, pick, pick + np.array([[0.05, 0.05, 0.03]])), Call())
    assert rolled.rewards[0] > -DIVERGED_PENALTY / 2
    piece = rolled.positions[0, -3:]
    np.testing.assert_allclose(piece - piece[0], lone - lone[0], atol=1e-3)


def test_nodes_in_a_row_are_no_cloth_but_stop_nothing(sheet, request_for):
    """A strip whose far end is one node wide: clustering leaves faces without area there."""
    low = sheet(side=0.1)
    row = np.array([[0.06 + 0.03 * i, 0.0, 0.0025] for i in range(4)], np.float32)
    nearest = int(np.linalg.norm(low.vertices - row[0], axis=1).argmin())
    ends = [nearest, *range(len(low.vertices), len(low.vertices) + 4)]
    mesh = ClothMesh(
        vertices=np.concatenate([low.vertices, row]),
        faces=np.concatenate([low.faces, np.array([ends[i : i + 3] for i in (1, 2)], np.int32)]),
        category="tshirt",
        visible=np.ones(len(low.vertices) + 4, bool),
    )
    pick = low.vertices[:1] + ABOVE
    rolled = Coarse(threads=1).roll_out(request_for(mesh, pick, pick + np.array([[0.05, 0.05, 0.03]])), Call())
    assert rolled.rewards[0] > -DIVERGED_PENALTY / 2


def test_a_mesh_that_is_one_node_is_refused(sheet, request_for):
    corner = sheet(side=0.012)
    speck = corner.model_copy(update={"vertices": corner.vertices + np.float32(0.01)})
    pick = speck.vertices[:1] + ABOVE
    with pytest.raises(BadRequest, match="coarse mesh"):
        Coarse(threads=1).roll_out(request_for(speck, pick, pick + np.float32(0.03)), Call())
