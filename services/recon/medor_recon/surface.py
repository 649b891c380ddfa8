"""A triangle mesh over the visible nodes: a height field as the camera sees it.

Delaunay in the image plane, then edges that cannot be cloth are cut. All faces look at the camera and no edge has more
than two, by construction. Alpha shapes close the back as well, with edges of three faces; ball pivoting loses nodes.
"""

import numpy as np
from scipy.spatial import Delaunay, QhullError

from medor_cloth.camera import Camera

SAMPLES = 32
"""Points along an edge at which the depth image is read."""


def surface(nodes: np.ndarray, depth: np.ndarray, camera: Camera, longest: float, gap: float) -> np.ndarray:
    """(F, 3) int32 faces over the nodes, wound counter-clockwise as the camera sees them; may be empty.

    The rim of an upper layer stays joined to what it lies on, so that planning can foresee that pulling at the rim
    brings out cloth from under it.

    Args:
        nodes: (V, 3) world frame [m].
        depth: (H, W) depth of the garment [m], 0 elsewhere.
        camera: which took it.
        longest: of an edge [m]. Centroids of neighbouring voxels are at most two voxels apart.
        gap: largest share of an edge that may run beside the garment, such as between two legs.
    """
    uv, _ = camera.project(nodes)
    try:
        faces = Delaunay(uv).simplices
    except QhullError:  # fewer than three nodes, or all on a line
        return np.empty((0, 3), np.int32)
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)
    kept = np.linalg.norm(np.diff(nodes[edges], axis=-2)[..., 0, :], axis=-1) < longest
    kept &= (_depth_along(uv[edges], depth) == 0).mean(axis=-1) <= gap
    return _facing_camera(faces[kept.all(axis=1)], uv)


def compact(nodes: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float32 that have a face, and the faces (F, 3) int32 renumbered."""
    used, faces = np.unique(faces, return_inverse=True)
    return nodes[used].astype(np.float32), faces.reshape(-1, 3).astype(np.int32)


def _depth_along(ends: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Depth (..., SAMPLES) read along image segments (..., 2 ends, 2)."""
    t = np.linspace(0, 1, SAMPLES)[:, None]
    uv = ends[..., :1, :] * (1 - t) + ends[..., 1:, :] * t
    columns, rows = np.moveaxis(uv.astype(int).clip(0, (depth.shape[1] - 1, depth.shape[0] - 1)), -1, 0)
    return depth[rows, columns]


def _facing_camera(faces: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Faces in the winding whose normal points at the camera. The image's v axis points down."""
    a, b = np.moveaxis(uv[faces[:, 1:]] - uv[faces[:, :1]], 1, 0)
    clockwise = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0
    return np.where(clockwise[:, None], faces[:, ::-1], faces).astype(np.int32)
