"""The visible points of a garment, thinned to the nodes of VCD's voxel grid."""

import numpy as np
from scipy.spatial import KDTree

from medor_recon.open3d_import import open3d
from medor_wire.errors import SeveralGarments

VOXEL_M = 0.0216
"""Side of a voxel (MEDOR, baselines: VCD)."""
MIN_SPACING = 1 / 3
"""Least distance of two nodes, in voxels. A slope that crosses from one voxel layer into the next puts two centroids
a millimetre apart; a spring of that length makes the cloth solver rigid."""
GAP_M = 0.05
"""Nodes farther apart on the table belong to different things: two garments, or a garment and a speck. Heights do not
count: what links a tall fold to the layer beneath is hidden."""
SECOND_GARMENT = 0.2
"""A separate thing with at least this share of all nodes is another garment, a smaller one is noise."""


def voxel_nodes(points: np.ndarray, voxel: float = VOXEL_M) -> np.ndarray:
    """(V, 3) float64 centroids [m] of the points (N, 3) in each voxel, near-duplicates merged."""
    grid = open3d.geometry.PointCloud(_vectors(points)).voxel_down_sample(voxel)
    nodes = open3d.geometry.TriangleMesh(grid.points, open3d.utility.Vector3iVector())
    return np.asarray(nodes.merge_close_vertices(voxel * MIN_SPACING).vertices)


def one_garment(nodes: np.ndarray) -> np.ndarray:
    """The nodes (V, 3) of the only garment, specks removed.

    Raises:
        SeveralGarments: two large groups of nodes, more than `GAP_M` apart.
    """
    on_table = open3d.geometry.PointCloud(_vectors(nodes * (1, 1, 0)))
    labels = np.asarray(on_table.cluster_dbscan(GAP_M, 1))
    sizes = np.bincount(labels)
    large = np.flatnonzero(sizes >= SECOND_GARMENT * len(nodes))
    if len(large) > 1:
        middles = [nodes[labels == k].mean(axis=0)[:2].round(3).tolist() for k in large]
        raise SeveralGarments(f"expected one garment in view, got {len(large)} around (x, y) = {middles}")
    return nodes[labels == sizes.argmax()]


def near(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(N,) bool: points (N, 3) that belong to the same thing on the table as the nodes (V, 3)."""
    distance, _ = KDTree(nodes[:, :2]).query(points[:, :2])
    return distance <= GAP_M / 2


def _vectors(points: np.ndarray):
    return open3d.utility.Vector3dVector(np.asarray(points, np.float64))
