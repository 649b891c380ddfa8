import numpy as np
import pytest

from medor_dynamics.graphs import Graphs
from medor_dynamics.neighbors import NO_SLOT, edges_of

RADIUS = 0.036
LINE = np.array([[0, 1], [1, 2], [2, 3]], np.int32)


def wired(positions, *, sizes=None, edges=None, nearest=0, close_mesh_edges=True):
    sizes = sizes or [len(positions)]
    edges = edges or [LINE for _ in sizes]
    graphs = Graphs.of(sizes, edges, [np.zeros(len(each)) for each in edges])
    senders, receivers, slots = edges_of(
        positions,
        graphs.starts,
        graphs.mesh_starts,
        graphs.mesh_senders,
        radius=RADIUS,
        nearest=nearest,
        close_mesh_edges=close_mesh_edges,
    )
    return senders, receivers, slots != NO_SLOT


def distances(positions):
    return np.linalg.norm(positions[:, None].astype(float) - positions[None], axis=-1)


def test_collision_edges_are_all_pairs_within_the_radius_in_both_directions(crumpled):
    senders, receivers, mesh = wired(crumpled)
    found = np.zeros((len(crumpled), len(crumpled)), int)
    np.add.at(found, (senders[~mesh], receivers[~mesh]), 1)
    close = (distances(crumpled) <= RADIUS) & ~np.eye(len(crumpled), dtype=bool)
    np.testing.assert_array_equal(found, close)
    np.testing.assert_array_equal(found, found.T)


def test_mesh_edges_are_there_in_both_directions_however_far(crumpled):
    senders, receivers, mesh = wired(crumpled)
    pairs = sorted(zip(senders[mesh].tolist(), receivers[mesh].tolist(), strict=True))
    assert pairs == sorted(pair for a, b in LINE.tolist() for pair in ((a, b), (b, a)))


def test_edges_are_sorted_by_receiver(crumpled):
    _, receivers, _ = wired(crumpled, nearest=4)
    assert (np.diff(receivers) >= 0).all()


@pytest.mark.parametrize("nearest", [1, 3, 200])
def test_the_nearest_are_kept(crumpled, nearest):
    senders, receivers, mesh = wired(crumpled, nearest=nearest)
    apart = distances(crumpled)
    for node in range(len(crumpled)):
        others = [other for other in np.argsort(apart[node]) if other != node and apart[node, other] <= RADIUS]
        assert senders[~mesh & (receivers == node)].tolist() == others[:nearest]


def test_neighbours_in_the_mesh_can_be_left_out(crumpled):
    crumpled[:4] = [[0, 0, 0.001 * at] for at in range(4)]
    senders, receivers, mesh = wired(crumpled, close_mesh_edges=False)
    ends = set(zip(senders[~mesh].tolist(), receivers[~mesh].tolist(), strict=True))
    assert (0, 1) not in ends
    assert (2, 1) not in ends
    assert (0, 2) in ends


def test_graphs_do_not_touch_each_other(crumpled):
    alone = wired(crumpled)
    both = wired(np.concatenate([crumpled, crumpled]), sizes=[60, 60])
    count = len(alone[0])
    for single, double in zip(alone, both, strict=True):
        np.testing.assert_array_equal(double[:count], single)
    np.testing.assert_array_equal(both[0][count:], alone[0] + 60)
    np.testing.assert_array_equal(both[1][count:], alone[1] + 60)


def test_nodes_that_flew_apart_cost_no_memory(crumpled):
    crumpled[0] = [1e3, -1e3, 0]
    senders, _, mesh = wired(crumpled)
    assert 0 not in senders[~mesh]
    assert len(senders) > 60
