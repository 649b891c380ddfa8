import numpy as np
import torch

from medor_dynamics.graphs import Graphs
from medor_dynamics.preset import CPU, PAPER

TRIANGLE = np.array([[0, 1], [1, 2], [0, 2]], np.int32)
LENGTHS = np.array([0.1, 0.2, 0.3], np.float32)


def test_a_repeated_graph_is_the_batch_of_its_copies():
    batch = Graphs.of([3] * 4, [TRIANGLE] * 4, [LENGTHS] * 4)
    repeated = Graphs.of([3], [TRIANGLE], [LENGTHS]).repeated(4)
    for name in ("starts", "mesh_starts", "mesh_senders", "rest", "graph_of"):
        np.testing.assert_array_equal(getattr(repeated, name), getattr(batch, name))


def test_both_directions_of_a_mesh_edge_have_its_rest_length():
    graphs = Graphs.of([3], [TRIANGLE], [LENGTHS])
    wiring = graphs.wire(torch.eye(3), PAPER)
    ends = wiring.senders.tolist(), wiring.receivers.tolist()
    rest = {(s, r): length for s, r, length in zip(*ends, wiring.rest.tolist(), strict=True)}
    for (a, b), length in zip(TRIANGLE.tolist(), LENGTHS, strict=True):
        assert rest[a, b] == rest[b, a] == np.float32(length)


def test_a_graph_beyond_numbers_does_not_disturb_the_others(crumpled):
    graphs = Graphs.of([60], [TRIANGLE], [LENGTHS]).repeated(2)
    fine = graphs.wire(torch.from_numpy(np.concatenate([crumpled, crumpled])), CPU)
    broken = torch.from_numpy(np.concatenate([np.full_like(crumpled, np.nan), crumpled]))
    broken[3] = np.inf
    wiring = graphs.wire(broken, CPU)
    for name in ("senders", "receivers"):
        ours, theirs = (getattr(each, name)[each.receivers >= 60] for each in (wiring, fine))
        torch.testing.assert_close(ours, theirs)
