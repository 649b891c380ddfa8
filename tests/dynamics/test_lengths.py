"""Edges get their lengths back."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from medor_dynamics.graphs import Graphs
from medor_dynamics.lengths import lengths_kept
from medor_dynamics.model import Grip, Motion
from medor_dynamics.node_mesh import NodeMesh
from medor_dynamics.preset import CPU, STEP_S

NOBODY = torch.empty(0, dtype=torch.long)


@pytest.fixture
def rods() -> tuple[Graphs, Tensor]:
    """Two rods that should be 0.1 m long: one is twice, one half as long."""
    rest = [np.array([0.1]), np.array([0.1])]
    graphs = Graphs.of([2, 2], [np.array([[0, 1]]), np.array([[0, 1]])], rest)
    return graphs, torch.tensor([[0, 0, 0], [0.2, 0, 0], [0, 1, 0], [0, 1.05, 0]])


@pytest.fixture
def sheet_graphs(sheet) -> tuple[Graphs, Tensor]:
    mesh = sheet(side=0.2)
    nodes = NodeMesh.of(mesh)
    positions = mesh.vertices[nodes.ids]
    return nodes.graphs(positions, CPU), torch.from_numpy(positions)


def lengths(graphs: Graphs, positions: Tensor) -> Tensor:
    return (positions[graphs.senders] - positions[graphs.receivers]).norm(dim=1)


def test_free_ends_share_the_way(rods):
    graphs, positions = rods
    kept = lengths_kept(graphs, positions, NOBODY, 30)
    expected = torch.tensor([[0.05, 0, 0], [0.15, 0, 0], [0, 0.975, 0], [0, 1.075, 0]])
    torch.testing.assert_close(kept, expected, atol=1e-6, rtol=0)


def test_what_is_held_stays_and_the_other_end_goes_all_the_way(rods):
    graphs, positions = rods
    kept = lengths_kept(graphs, positions, torch.tensor([1]), 30)
    expected = torch.tensor([[0.1, 0, 0], [0.2, 0, 0], [0, 0.975, 0], [0, 1.075, 0]])
    torch.testing.assert_close(kept, expected, atol=1e-6, rtol=0)
    torch.testing.assert_close(kept[1], positions[1], atol=0, rtol=0)


def test_cloth_of_the_right_lengths_is_left_alone(sheet_graphs):
    graphs, positions = sheet_graphs
    torch.testing.assert_close(lengths_kept(graphs, positions, NOBODY, 5), positions, atol=1e-7, rtol=0)


@pytest.mark.parametrize("error_m", [0.003, 0.01])
def test_every_pass_brings_a_disturbed_cloth_nearer_to_its_lengths(sheet_graphs, error_m):
    graphs, positions = sheet_graphs
    disturbed = positions + error_m * torch.randn(positions.shape, generator=torch.manual_seed(0))
    wrong = [
        (lengths(graphs, lengths_kept(graphs, disturbed, NOBODY, passes)) - graphs.rest).abs().mean().item()
        for passes in (0, 2, 5, 20)
    ]
    assert wrong == sorted(wrong, reverse=True)
    assert wrong[2] < 0.5 * wrong[0]


def test_the_gradient_is_that_of_finite_differences(rods):
    graphs, positions = rods
    graphs = replace(graphs, rest=graphs.rest.double())
    held = torch.tensor([1])
    positions = positions.double().requires_grad_()
    assert torch.autograd.gradcheck(lambda at: lengths_kept(graphs, at, held, 3), positions)


def test_without_gradients_the_kernel_does_the_same(sheet_graphs):
    graphs, positions = sheet_graphs
    disturbed = positions + 0.01 * torch.randn(positions.shape, generator=torch.manual_seed(0))
    held = torch.tensor([3, 17])
    expected = lengths_kept(graphs, disturbed, held, 5)
    with torch.inference_mode():
        kept = lengths_kept(graphs, disturbed, held, 5)
    assert (expected - disturbed).norm(dim=1).max() > 0.005
    torch.testing.assert_close(kept, expected, atol=1e-6, rtol=0)
    torch.testing.assert_close(kept[held], disturbed[held], atol=0, rtol=0)


def test_velocities_are_those_of_the_places_that_are_kept(sheet_graphs, model):
    """As in the recordings that models are taught with, and the node held still moves as its picker."""
    graphs, positions = sheet_graphs
    motion, grip = Motion.resting(positions), Grip(torch.tensor([7]), torch.tensor([[0.02, 0, 0.01]]))
    after = model(replace(CPU, width=16, blocks=1))(graphs, motion, grip)
    torch.testing.assert_close(after.velocities[:, 0], (after.positions - positions) / STEP_S)
    torch.testing.assert_close(after.positions[7], positions[7] + grip.displacement[0])
