"""What all backends have in common that move the nodes of the coarse mesh."""

import time

import numpy as np
import pytest

from medor_cloth.coverage import coverage
from medor_dynamics.coarse import Coarse
from medor_dynamics.learned import Learned
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.on_nodes import OnNodes
from medor_dynamics.rollout import CHUNK
from medor_wire.bus import Call
from medor_wire.errors import Cancelled, Timeout
from medor_wire.messages import ClothMesh, Reward

ABOVE = np.array([0, 0, 0.01], np.float32)


@pytest.fixture(params=["learned", "coarse"])
def backend(request, model) -> OnNodes:
    return Coarse(threads=1) if request.param == "coarse" else Learned(model().predictor(), threads=1)


def pulls_of(mesh: ClothMesh, count: int = 6) -> tuple[np.ndarray, np.ndarray]:
    picks = mesh.vertices[np.linspace(0, len(mesh.vertices) - 1, count).astype(int)] + ABOVE
    return picks, picks + np.array([0.05, 0.02, 0.03], np.float32)


def test_the_fine_mesh_follows_its_nodes(backend, sheet, request_for):
    mesh = sheet()
    picks, places = pulls_of(mesh)
    rollouts = backend.roll_out(request_for(mesh, picks, places), Call())
    assert rollouts.positions.shape == (len(picks), len(mesh.vertices), 3)
    for state, reward in zip(rollouts.positions, rollouts.rewards, strict=True):
        assert reward == pytest.approx(coverage(state, mesh.faces))
    assert np.abs(rollouts.positions - mesh.vertices).max() > 0.02


def test_a_pick_that_grasps_nothing_leaves_the_cloth_as_it_is(backend, sheet, request_for):
    mesh = sheet()
    picks, places = pulls_of(mesh, 3)
    picks[1, 2] += 1
    rollouts = backend.roll_out(request_for(mesh, picks, places), Call())
    np.testing.assert_array_equal(rollouts.positions[1], mesh.vertices)
    alone = backend.roll_out(request_for(mesh, picks[[0, 2]], places[[0, 2]]), Call())
    np.testing.assert_allclose(rollouts.positions[[0, 2]], alone.positions, atol=1e-6)


def test_only_empty_picks_need_no_model(backend, sheet, request_for):
    mesh = sheet()
    up = np.array([[0, 0, 1.0]])
    assert backend.roll_out(request_for(mesh, up, up), Call()).rewards[0] == coverage(mesh.vertices, mesh.faces)


def test_nodes_are_vertices_and_vertices_between_them_move_between(sheet):
    mesh = sheet(side=0.15)
    nodes = NodeMesh.of(mesh)
    start = mesh.vertices[nodes.ids]
    shift = np.array([0.1, 0.2, 0.3], np.float32)
    np.testing.assert_allclose(nodes.follow(mesh.vertices, (start + shift)[None])[0], mesh.vertices + shift, atol=1e-6)
    stretched = nodes.follow(mesh.vertices, (start * 1.1)[None])[0]
    np.testing.assert_allclose(stretched[nodes.ids], start * 1.1, atol=1e-5)


def test_layers_that_lie_on_each_other_are_told_apart_by_the_worn_shape(sheet):
    """The node of a vertex belongs to its own layer, although one of the other layer may be nearer on the table."""
    low, high = sheet(), sheet(height=0.006)
    vertices = np.concatenate([low.vertices, high.vertices])
    worn = np.concatenate([low.vertices, high.vertices + np.array([0, 0, 0.1], np.float32)])
    mesh = ClothMesh(
        vertices=vertices,
        faces=np.concatenate([low.faces, high.faces + len(low.vertices)]),
        category="tshirt",
        visible=np.ones(len(vertices), bool),
        canonical=worn,
    )
    nodes = NodeMesh.of(mesh)
    layer_of_node = nodes.ids >= len(low.vertices)
    layer_of_vertex = np.arange(len(vertices)) >= len(low.vertices)
    assert (layer_of_node[[nodes.node_of(vertex) for vertex in range(len(vertices))]] == layer_of_vertex).all()


def test_cancelling_stops_before_the_next_chunk(backend, sheet, request_for):
    mesh = sheet()
    picks, places = pulls_of(mesh, 5 * CHUNK)
    told: list = []

    def cancel(message) -> None:
        told.append(message)
        call.withdraw()

    call = Call(progress=cancel)
    with pytest.raises(Cancelled):
        backend.roll_out(request_for(mesh, picks, places), call)
    assert len(told) < 4


def test_a_deadline_that_has_passed_is_respected(backend, sheet, request_for):
    mesh = sheet()
    with pytest.raises(Timeout):
        backend.roll_out(request_for(mesh, *pulls_of(mesh)), Call(deadline=time.monotonic() - 1))


def test_canonicalize_rewards_closeness_to_the_goal(backend, sheet, request_for):
    mesh = sheet()
    up = np.array([[0, 0, 1.0]])
    reward = Reward(task="canonicalize", goals=mesh.vertices[None])
    assert backend.roll_out(request_for(mesh, up, up, reward), Call()).rewards[0] == pytest.approx(0, abs=1e-6)
