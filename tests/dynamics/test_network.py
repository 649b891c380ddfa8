from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_dynamics import dense
from medor_dynamics.graphs import Graphs
from medor_dynamics.lean import LeanNetwork
from medor_dynamics.network import EDGE_FEATURES, NODE_FEATURES, Block, GraphNetwork
from medor_dynamics.plain import pass_messages
from medor_dynamics.preset import CPU, PAPER

PRESETS = [CPU, replace(PAPER, width=16, blocks=3)]


@pytest.fixture
def wiring(crumpled):
    graphs = Graphs.of([60], [np.array([[0, 1], [1, 2]])], [np.ones(2)]).repeated(2)
    return graphs.wire(torch.from_numpy(np.concatenate([crumpled, crumpled * 1.1])), PAPER)


def random_features(wiring) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    nodes = torch.randn(len(wiring.graph_of), NODE_FEATURES, generator=generator)
    return nodes, torch.randn(len(wiring.senders), EDGE_FEATURES, generator=generator)


def test_the_papers_network_has_its_size():
    """MEDOR: 2.7 million parameters. Encoders 18 and 7 wide at their ends, ten blocks of three networks, a decoder."""
    hidden = 2 * (128 * 128 + 128)
    encoders = (18 * 128 + 128 + hidden) + (7 * 128 + 128 + hidden)
    block = (4 * 128 * 128 + 128 + hidden) + 2 * (3 * 128 * 128 + 128 + hidden)
    decoder = hidden + 128 * 3 + 3
    network = GraphNetwork(PAPER)
    assert sum(parameter.numel() for parameter in network.parameters()) == encoders + 10 * block + decoder == 2_735_875


@pytest.mark.parametrize("preset", PRESETS)
def test_the_split_first_layer_is_the_layer_over_everything_at_once(preset, wiring):
    torch.manual_seed(0)
    block = GraphNetwork(preset).blocks[0]
    assert isinstance(block, Block)
    nodes, edges = torch.randn(120, preset.width), torch.randn(len(wiring.senders), preset.width)
    first = wiring.receivers < 60
    alone = pass_messages(
        block, nodes[:60], edges[first], torch.zeros(preset.width), wiring.senders[first], wiring.receivers[first]
    )
    split = block(nodes, edges, torch.zeros(2, preset.width), wiring)
    torch.testing.assert_close(split[0][:60], alone[0])
    torch.testing.assert_close(split[1][first], alone[1])
    torch.testing.assert_close(split[2][0], alone[2])


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.bfloat16, 0.02)])
def test_the_lean_network_computes_what_the_network_does(preset, wiring, dtype, tolerance):
    torch.manual_seed(0)
    network = GraphNetwork(preset).eval()
    nodes, edges = random_features(wiring)
    with torch.inference_mode():
        full = network(nodes, edges, wiring)
        lean = LeanNetwork(network, dtype)(nodes.to(dtype), edges.to(dtype), wiring).float()
    assert (lean - full).abs().max() <= tolerance * full.abs().max()


@pytest.mark.parametrize("fused", [True, False])
@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.bfloat16, 0.015)])
def test_ten_lean_networks_compute_what_the_networks_do(preset, wiring, dtype, tolerance, fused, monkeypatch):
    """The largest error in units of the largest output, mean of ten networks, fused layers or not."""
    if not fused:
        monkeypatch.setattr(dense, "can_fuse", lambda dtype: False)
    errors = []
    for seed in range(10):
        torch.manual_seed(seed)
        network = GraphNetwork(preset).eval()
        nodes, edges = random_features(wiring)
        with torch.inference_mode():
            full = network(nodes, edges, wiring)
            lean = LeanNetwork(network, dtype)(nodes.to(dtype), edges.to(dtype), wiring).float()
        errors.append((lean - full).abs().max() / full.abs().max())
    assert torch.stack(errors).mean() <= tolerance


def test_a_lean_network_is_a_copy(wiring):
    network = GraphNetwork(CPU).eval()
    lean = LeanNetwork(network, torch.float32)
    with torch.inference_mode():
        before = lean(*random_features(wiring), wiring)
        for parameter in network.parameters():
            parameter.zero_()
        torch.testing.assert_close(lean(*random_features(wiring), wiring), before)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_order_of_nodes_means_nothing(preset, crumpled):
    """Renumbered nodes get the same accelerations."""
    torch.manual_seed(0)
    network = GraphNetwork(preset).eval()
    order = np.random.default_rng(3).permutation(60)
    rank = np.argsort(order)
    edges = np.array([[0, 1], [1, 2]])
    nodes = torch.randn(60, NODE_FEATURES)

    def out(positions, mesh_edges, features):
        wiring = Graphs.of([60], [mesh_edges], [np.ones(2)]).wire(torch.from_numpy(positions), preset)
        offset = torch.from_numpy(positions[wiring.receivers] - positions[wiring.senders])
        return network(features, torch.cat([offset, torch.zeros(len(offset), 4)], dim=1), wiring)

    torch.testing.assert_close(out(crumpled[order], rank[edges], nodes[order]), out(crumpled, edges, nodes)[order])
