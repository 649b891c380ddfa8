from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_dynamics.graphs import Graphs
from medor_dynamics.model import Grip, Motion, edge_features, injected, node_features
from medor_dynamics.preset import CPU, PAPER, STEP_S

EDGES = np.array([[0, 1], [1, 2], [2, 3]])


def moving(positions: np.ndarray) -> Motion:
    velocities = np.random.default_rng(1).normal(size=(len(positions), 5, 3)).astype(np.float32)
    return Motion(torch.from_numpy(positions), torch.from_numpy(velocities))


def graphs_of(positions: np.ndarray) -> Graphs:
    rest = np.linalg.norm(positions[EDGES[:, 0]] - positions[EDGES[:, 1]], axis=1)
    return Graphs.of([len(positions)], [EDGES], [rest])


def grip(node: int, displacement) -> Grip:
    return Grip(torch.tensor([node]), torch.tensor([displacement], dtype=torch.float32))


OPEN = Grip(torch.zeros(0, dtype=torch.long), torch.zeros(0, 3))


@pytest.mark.parametrize("preset", [CPU, PAPER])
def test_features_do_not_know_where_in_the_plane_the_cloth_lies(crumpled, preset):
    moved = crumpled + np.array([0.25, -0.5, 0], np.float32)
    graphs = graphs_of(crumpled)
    wirings = [graphs.wire(torch.from_numpy(each), preset) for each in (crumpled, moved)]
    here, there = (edge_features(torch.from_numpy(p), w) for p, w in zip((crumpled, moved), wirings, strict=True))
    torch.testing.assert_close(here, there, atol=1e-6, rtol=0)
    torch.testing.assert_close(node_features(moving(crumpled), OPEN), node_features(moving(moved), OPEN))


def test_height_is_a_feature(crumpled):
    raised = node_features(moving(crumpled + np.array([0, 0, 0.1], np.float32)), OPEN)
    assert (raised[:, 15] - node_features(moving(crumpled), OPEN)[:, 15]).numpy() == pytest.approx(0.1)


def test_stretch_is_zero_before_the_action_and_for_collision_edges(crumpled):
    wiring = graphs_of(crumpled).wire(torch.from_numpy(crumpled), PAPER)
    assert edge_features(torch.from_numpy(crumpled), wiring)[:, 4].abs().max() < 1e-7
    pulled = crumpled * np.float32(1.5)
    stretch = edge_features(torch.from_numpy(pulled), graphs_of(crumpled).wire(torch.from_numpy(pulled), PAPER))
    assert (stretch[stretch[:, 6] == 1, 4] > 0).all()
    assert (stretch[stretch[:, 5] == 1, 4] == 0).all()


def test_an_edge_and_its_opposite_see_each_other(crumpled):
    wiring = graphs_of(crumpled).wire(torch.from_numpy(crumpled), PAPER)
    features = edge_features(torch.from_numpy(crumpled), wiring)
    ends = wiring.senders, wiring.receivers, wiring.mesh
    rows = {(s, r, m): row for s, r, m, row in zip(*(part.tolist() for part in ends), features, strict=True)}
    for (sender, receiver, mesh), row in rows.items():
        opposite = rows[receiver, sender, mesh]
        torch.testing.assert_close(opposite[:3], -row[:3])
        torch.testing.assert_close(opposite[3:], row[3:])


def test_the_action_is_known_before_the_network_looks(crumpled):
    motion = moving(crumpled)
    held = grip(7, [0.01, 0, 0.02])
    moved = injected(motion, held)
    torch.testing.assert_close(moved.positions[7], motion.positions[7] + held.displacement[0])
    torch.testing.assert_close(moved.velocities[7, 0], held.displacement[0] / STEP_S)
    torch.testing.assert_close(moved.velocities[7, 1:], motion.velocities[7, :-1])
    others = torch.arange(60) != 7
    torch.testing.assert_close(moved.positions[others], motion.positions[others], rtol=0, atol=0)
    assert node_features(moved, held)[:, 17].tolist() == [float(node == 7) for node in range(60)]


def test_the_held_node_moves_as_the_picker_whatever_the_network_says(crumpled, model):
    motion = moving(crumpled)
    held = grip(7, [0.01, 0, 0.02])
    after = model()(graphs_of(crumpled), motion, held)
    torch.testing.assert_close(after.positions[7], motion.positions[7] + held.displacement[0], rtol=0, atol=0)
    torch.testing.assert_close(after.velocities[7, 0], held.displacement[0] / STEP_S)


def test_without_acceleration_nodes_keep_their_velocity(crumpled, model):
    still = model(PAPER)
    torch.nn.init.zeros_(still.network.decode[4].weight)
    torch.nn.init.zeros_(still.network.decode[4].bias)
    motion = moving(crumpled)
    after = still(graphs_of(crumpled), motion, OPEN)
    torch.testing.assert_close(after.positions, motion.positions + motion.velocities[:, 0] * STEP_S)
    torch.testing.assert_close(after.velocities[:, 0], motion.velocities[:, 0])
    torch.testing.assert_close(after.velocities[:, 1:], motion.velocities[:, :-1])


def test_the_normalizer_does_not_prefer_a_heading(crumpled, model):
    fitted = model(replace(CPU, normalize=True)).normalizer
    features = node_features(moving(crumpled), OPEN)
    fitted.fit(features, torch.randn(50, 7), torch.randn(50, 3))
    scaled = fitted.nodes(features)
    torch.testing.assert_close(scaled[:, :15] * fitted.node_scale[0], features[:, :15])
    assert scaled[:, 15].mean().abs() < 1e-5
    assert scaled[:, 15].std() == pytest.approx(1, abs=1e-4)
    torch.testing.assert_close(scaled[:, 16:], features[:, 16:])
