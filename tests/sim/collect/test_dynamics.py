import numpy as np

from medor_cloth.cluster import cluster
from medor_cloth.raster import visible_vertices
from medor_sim.collect.dynamics import CAMERA, LENGTH_M, random_place


def test_seventeen_records_of_all_vertices(dynamics_data):
    for trajectory in dynamics_data:
        assert trajectory["positions"].shape == (17, len(trajectory.garment["vertices"]), 3)


def test_the_vertex_held_follows_the_picker_until_it_opens(dynamics_data):
    for trajectory in dynamics_data:
        pick, place = trajectory["move"]
        held = trajectory["positions"][:, trajectory["grasp"][1]]
        carried = held[:11] - (pick + np.linspace(0, 1, 11)[:, None] * (place - pick))
        np.testing.assert_allclose(carried, carried[:1].repeat(11, 0), atol=1e-4)
        assert held[-1, 2] < held[10, 2] + 1e-4, "it falls"


def test_picks_aim_at_visible_nodes(dynamics_data):
    for trajectory in dynamics_data:
        ids, node = trajectory.garment["node_ids"], trajectory["grasp"][0]
        start = trajectory["positions"][0]
        assert trajectory["visible"][node]
        np.testing.assert_allclose(trajectory["move"][0], start[ids[node]] + [0, 0, 0.01], atol=1e-4)
        again = visible_vertices(start, trajectory.garment["faces"], CAMERA)[ids]
        assert (again == trajectory["visible"]).mean() > 0.95, "but for what storing rounds"


def test_pulls_rise_and_stay_within_their_lengths_and_the_view():
    rng = np.random.default_rng(0)
    pick = np.array([0.05, -0.1, 0.02], np.float32)
    places = np.stack([random_place(pick, rng) for _ in range(200)])
    length = np.linalg.norm(places - pick, axis=1)
    assert (places[:, 2] >= pick[2]).all()
    assert LENGTH_M[0] - 1e-5 <= length.min()
    assert length.max() <= LENGTH_M[1] + 1e-5
    assert CAMERA.contains(places).all()


def test_nodes_are_the_clustered_canonical_mesh(dynamics_data):
    record = dynamics_data.garments[0]
    nodes = cluster(record["vertices"], record["faces"])
    np.testing.assert_array_equal(record["node_ids"], nodes.ids)
    np.testing.assert_array_equal(record["node_edges"], nodes.edges)
    assert record["node_rest_lengths"].shape == (len(nodes.edges),)
    assert (record["node_rest_lengths"] > 0).all()
