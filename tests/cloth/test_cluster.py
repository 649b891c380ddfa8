import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from medor_cloth.cluster import VOXEL_M, cluster


def box_of_cloth(gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Two sheets of 0.2 m a gap apart (front and back), joined along one side; vertices every 8 mm."""
    side = np.linspace(0, 0.2, 26)
    x, z = np.meshgrid(side, side)
    front = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)
    i = np.arange(26 * 26).reshape(26, 26)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    n = len(front)
    p, q = i[0, :-1], i[0, 1:]
    joint = np.concatenate([np.stack([p, q, p + n], 1), np.stack([q, q + n, p + n], 1)])
    vertices = np.concatenate([front, front + [0, gap, 0]]).astype(np.float32)
    return vertices, np.concatenate([faces, faces[:, ::-1] + n, joint]).astype(np.int32)


@pytest.fixture(scope="module")
def mesh():
    return box_of_cloth(0.03)


def test_every_coarse_vertex_is_a_different_fine_vertex_and_every_voxel_has_one(mesh):
    vertices, faces = mesh
    coarse = cluster(vertices, faces)
    assert coarse.ids.dtype == np.int32
    assert len(np.unique(coarse.ids)) == len(coarse.ids)
    occupied = np.unique(np.floor(vertices.astype(np.float64) / VOXEL_M), axis=0)
    chosen = np.unique(np.floor(vertices[coarse.ids].astype(np.float64) / VOXEL_M), axis=0)
    np.testing.assert_array_equal(chosen, occupied)
    assert len(vertices) / 20 < len(coarse.ids) < len(vertices) / 4


def test_the_representative_is_the_member_nearest_to_the_average():
    vertices = np.array([[0.001, 0, 0], [0.009, 0, 0], [0.010, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    coarse = cluster(vertices, np.array([[0, 3, 4], [1, 2, 3]]))
    assert coarse.ids.tolist() == [1, 3, 4]


def test_layers_farther_apart_than_a_voxel_never_merge(mesh):
    vertices, faces = mesh
    coarse = cluster(vertices, faces)
    layer = vertices[coarse.ids, 1] > 0.015
    across = layer[coarse.edges[:, 0]] != layer[coarse.edges[:, 1]]
    # Layers are joined along the seam (z = 0) only.
    assert across.any()
    assert vertices[coarse.ids[coarse.edges[across].ravel()], 2].max() < 2 * VOXEL_M


def test_edges_are_undirected_unique_and_hold_those_of_the_faces(mesh):
    coarse = cluster(*mesh)
    assert (coarse.edges[:, 0] < coarse.edges[:, 1]).all()
    edges = {tuple(edge) for edge in coarse.edges.tolist()}
    assert len(edges) == len(coarse.edges)
    of_faces = np.sort(coarse.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert {tuple(edge) for edge in of_faces.tolist()} <= edges


def test_faces_are_proper_unique_and_keep_their_winding(mesh):
    vertices, faces = mesh
    coarse = cluster(vertices, faces)
    assert (np.diff(np.sort(coarse.faces, axis=1), axis=1) > 0).all()
    assert len(np.unique(np.sort(coarse.faces, axis=1), axis=0)) == len(coarse.faces)
    corners = vertices[coarse.ids[coarse.faces]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    front, back = (corners[..., 1] < 0.015).all(axis=1), (corners[..., 1] > 0.015).all(axis=1)
    assert (normal[front, 1] <= 1e-12).all()
    assert (normal[back, 1] >= -1e-12).all()


def test_a_connected_mesh_stays_connected(mesh):
    for voxel in (0.02, 0.025, 0.06, 0.11):
        coarse = cluster(*mesh, voxel=voxel)
        a, b = coarse.edges.T
        graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(coarse.ids),) * 2)
        assert connected_components(graph, directed=False)[0] == 1


def test_small_voxels_return_the_mesh_itself(mesh):
    vertices, faces = mesh
    coarse = cluster(vertices, faces, voxel=0.002)
    assert len(coarse.ids) == len(vertices)
    np.testing.assert_array_equal(coarse.ids[coarse.faces], faces)
