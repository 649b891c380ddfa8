from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_dynamics.frame import headings, turned
from medor_dynamics.plain import roll_out_plainly
from medor_dynamics.preset import CPU, PAPER
from medor_dynamics.rollout import Pulls, roll_out

SMALL = {
    "cpu": replace(CPU, width=16, blocks=2, normalize=False),
    "paper": replace(PAPER, width=16, blocks=2),
}


@pytest.fixture
def cloth(sheet):
    from medor_dynamics.node_mesh import NodeMesh

    mesh = sheet(side=0.2)
    nodes = NodeMesh.of(mesh)
    return nodes, mesh.vertices[nodes.ids]


def lively(model):
    """Accelerations of the size cloth has, from an untrained network."""
    model.normalizer.acceleration_scale.fill_(20)
    return model


def pulls_on(positions: np.ndarray, count: int = 5) -> Pulls:
    rng = np.random.default_rng(2)
    displacements = rng.uniform((-0.15, -0.15, 0), 0.15, (count, 3)).astype(np.float32)
    return Pulls(rng.integers(len(positions), size=count), displacements)


@pytest.mark.parametrize("preset", SMALL)
def test_a_batch_is_the_plain_rollout_of_each(cloth, model, preset):
    nodes, positions = cloth
    learnt = lively(model(SMALL[preset]))
    pulls = pulls_on(positions)
    rest = nodes.rest_lengths(positions, learnt.preset)
    batch = roll_out(learnt.predictor(), nodes.graphs(positions, learnt.preset), positions, pulls, chunk=3)
    for after, node, pull in zip(batch, pulls.nodes, pulls.displacements, strict=True):
        plain = roll_out_plainly(learnt, nodes.edges, rest, positions, int(node), pull)
        np.testing.assert_allclose(after, plain, atol=1e-4)
    assert np.linalg.norm(batch - positions, axis=-1).mean() > 0.01


def test_neither_chunks_nor_threads_matter(cloth, model):
    nodes, positions = cloth
    learnt = lively(model(SMALL["cpu"]))
    graph, pulls = nodes.graphs(positions, learnt.preset), pulls_on(positions)
    one = roll_out(learnt.predictor(), graph, positions, pulls, chunk=1, threads=1)
    many = roll_out(learnt.predictor(), graph, positions, pulls, chunk=2, threads=2)
    np.testing.assert_allclose(one, many, atol=1e-6)
    np.testing.assert_array_equal(many, roll_out(learnt.predictor(), graph, positions, pulls, chunk=2, threads=2))


def test_the_held_node_travels_the_pull_and_falls_no_further_without_acceleration(cloth, model):
    nodes, positions = cloth
    still = model(SMALL["paper"])
    still.normalizer.acceleration_scale.zero_()
    pulls = pulls_on(positions)
    after = roll_out(still.predictor(), nodes.graphs(positions, still.preset), positions, pulls)
    for state, node, pull in zip(after, pulls.nodes, pulls.displacements, strict=True):
        others = np.arange(len(positions)) != node
        np.testing.assert_allclose(state[others], positions[others], atol=1e-6)
        coasting = 1.6  # the velocity of the pull lasts: six more steps
        np.testing.assert_allclose(state[node] - positions[node], coasting * pull, atol=1e-5)


@pytest.mark.parametrize(("preset", "equivariant"), [("cpu", True), ("paper", False)])
def test_a_turned_scene_gives_the_turned_rollout_in_the_frame_of_the_pull(cloth, model, preset, equivariant):
    """In the world's frame, which is the paper's, it does not."""
    nodes, positions = cloth
    learnt = lively(model(SMALL[preset]))
    angle, pulls = np.array([0.7]), pulls_on(positions, 3)
    around = turned(positions, angle)[0]
    turned_pulls = Pulls(pulls.nodes, turned(pulls.displacements, angle)[0])
    before = roll_out(learnt.predictor(), nodes.graphs(positions, learnt.preset), positions, pulls)
    after = roll_out(learnt.predictor(), nodes.graphs(around, learnt.preset), around, turned_pulls)
    difference = np.abs(after - turned(before, np.repeat(angle, 3))).max()
    assert (difference < 1e-4) == equivariant


def test_the_frame_of_the_pull_has_x_along_it():
    pulls = np.array([[0.1, 0.2, 0.3], [-0.1, 0, 0], [0, 0, 0.1]], np.float32)
    ahead = turned(pulls[:, None], -headings(pulls, CPU))[:, 0]
    np.testing.assert_allclose(ahead[:, 1], 0, atol=1e-7)
    np.testing.assert_allclose(ahead[:, 0], np.hypot(pulls[:, 0], pulls[:, 1]), rtol=1e-6)
    np.testing.assert_allclose(ahead[:, 2], pulls[:, 2])


def test_a_rollout_that_leaves_the_numbers_leaves_alone(cloth, model):
    nodes, positions = cloth
    learnt = lively(model(SMALL["cpu"]))
    graph, pulls = nodes.graphs(positions, learnt.preset), pulls_on(positions, 3)
    fine = roll_out(learnt.predictor(), graph, positions, pulls, chunk=3)
    pulls.displacements[1] = 1e30
    after = roll_out(learnt.predictor(), graph, positions, pulls, chunk=3)
    assert not (np.abs(after[1]) < 1e3).all()
    np.testing.assert_allclose(after[[0, 2]], fine[[0, 2]], atol=1e-6)


def test_progress_and_an_end_between_chunks(cloth, model):
    nodes, positions = cloth
    learnt = model()
    told = []

    def check() -> None:
        if told:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        roll_out(
            learnt.predictor(),
            nodes.graphs(positions, learnt.preset),
            positions,
            pulls_on(positions, 8),
            chunk=2,
            check=check,
            on_done=told.append,
        )
    assert told
    assert told[-1] < 8


def test_bfloat16_stays_close(cloth, model):
    nodes, positions = cloth
    learnt = lively(model(SMALL["cpu"]))
    graph, pulls = nodes.graphs(positions, learnt.preset), pulls_on(positions)
    full, half = (
        roll_out(learnt.predictor(dtype), graph, positions, pulls) for dtype in (torch.float32, torch.bfloat16)
    )
    moved = np.linalg.norm(full - positions, axis=-1).mean()
    assert np.linalg.norm(half - full, axis=-1).mean() < 0.05 * moved
