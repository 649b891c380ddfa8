"""Depth images and visibility of triangle meshes.

Every triangle is solved in homogeneous coordinates: a pixel's ray of unit depth, written as a combination of the
triangle's corners, has the barycentric coordinates (divided by their sum) and 1/depth (their sum) as its
coefficients. This equals casting a ray through every pixel centre, perspective included, and needs no clipping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from medor_cloth.camera import Camera


@dataclass(frozen=True, eq=False)
class Raster:
    """What a camera sees of a mesh, per pixel.

    Attributes:
        depth: (H, W) float32, z in the camera frame [m]; 0 where there is no cloth.
        face: (H, W) int32 index of the face seen; -1 where there is no cloth.
        barycentric: (H, W, 3) float32 weights of the face's corners (perspective-correct); 0 where no cloth.
    """

    depth: np.ndarray
    face: np.ndarray
    barycentric: np.ndarray

    @property
    def mask(self) -> np.ndarray:
        """(H, W) bool, true where cloth is seen."""
        return self.face >= 0


def rasterize(vertices: np.ndarray, faces: np.ndarray, camera: Camera) -> Raster:
    """Depth, face and barycentric coordinates seen at every pixel centre.

    Args:
        vertices: (V, 3) world frame [m].
        faces: (F, 3) int, either winding; both sides are seen. Faces with a corner that is NaN are not.
        camera: where from.
    """
    edges, plane, bounds = _setup(camera, vertices, faces)
    shape = (camera.height, camera.width)
    # Allocated here because numpy, unlike numba, takes zeroed pages that cost nothing until they are written.
    raster = Raster(np.zeros(shape, np.float32), np.full(shape, -1, np.int32), np.zeros((*shape, 3), np.float32))
    _nearest_faces(edges, plane, bounds, raster.depth, raster.face)
    _resolve(edges, raster.depth, raster.face, raster.barycentric)
    return raster


def visible_vertices(vertices: np.ndarray, faces: np.ndarray, camera: Camera, tolerance: float = 0.002) -> np.ndarray:
    """(V,) bool: vertices inside the image with no cloth in front of them.

    Visibility is decided on the ray through the vertex itself, so it does not depend on the image resolution.

    Args:
        vertices: (V, 3) world frame [m].
        faces: (F, 3) int.
        camera: where from.
        tolerance: cloth nearer to the vertex than this depth [m] does not hide it.
    """
    edges, plane, bounds = _setup(camera, vertices, faces)
    uv, depth = camera.project(vertices)
    inside = camera.contains(vertices)
    order = np.flatnonzero(inside)[np.argsort(uv[inside, 0], kind="stable")]
    hidden = _hidden(edges, plane, bounds, uv[order], depth[order] - tolerance)
    visible = inside.copy()
    visible[order[hidden]] = False
    return visible


def _setup(camera: Camera, vertices: np.ndarray, faces: np.ndarray):
    return _triangles(camera.to_camera(vertices), np.ascontiguousarray(faces, np.int32), camera.K, camera.K_inverse)


@njit(nogil=True, cache=True)
def _triangles(points, faces, K, K_inverse):
    """Edge functions (F,3,3), inverse-depth planes (F,3) and pixel bounds (F,4), all linear in (u, v, 1)."""
    n_faces = faces.shape[0]
    edges = np.zeros((n_faces, 3, 3))
    plane = np.zeros((n_faces, 3))
    bounds = np.zeros((n_faces, 4))
    for f in range(n_faces):
        bounds[f] = _bounds(points, faces[f], K)
        for k in range(3):
            a, b = points[faces[f, (k + 1) % 3]], points[faces[f, (k + 2) % 3]]
            # The cross product changes only its sign when a and b are exchanged, so that two faces agree
            # bit by bit on which side of their common edge a pixel lies: no cracks.
            x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
            for i in range(3):
                edges[f, k, i] = x * K_inverse[0, i] + y * K_inverse[1, i] + z * K_inverse[2, i]
            if k == 0:
                c = points[faces[f, 0]]
                volume = x * c[0] + y * c[1] + z * c[2]
        if volume < 0:
            edges[f] = -edges[f]
        if not 0 < abs(volume) < np.inf:  # seen edge-on, or with a corner that is not a number
            bounds[f] = (0.0, -1.0, 0.0, -1.0)
        else:
            plane[f] = (edges[f, 0] + edges[f, 1] + edges[f, 2]) / abs(volume)
    return edges, plane, bounds


@njit(nogil=True, cache=True)
def _bounds(points, face, K):
    """(u_min, u_max, v_min, v_max) of a face; everything when it reaches behind the camera."""
    u_min, u_max, v_min, v_max = np.inf, -np.inf, np.inf, -np.inf
    behind = 0
    for k in range(3):
        p = points[face[k]]
        if p[2] > 1e-9:
            u = (K[0, 0] * p[0] + K[0, 1] * p[1]) / p[2] + K[0, 2]
            v = (K[1, 0] * p[0] + K[1, 1] * p[1]) / p[2] + K[1, 2]
            u_min, u_max = min(u_min, u), max(u_max, u)
            v_min, v_max = min(v_min, v), max(v_max, v)
        else:
            behind += 1
    if behind == 3:
        return 0.0, -1.0, 0.0, -1.0
    if behind > 0:
        return -np.inf, np.inf, -np.inf, np.inf
    return u_min, u_max, v_min, v_max


@njit(nogil=True, cache=True)
def _span(low, high, size):
    """First and last pixel whose centre lies in [low, high], widened by rounding, within [0, size)."""
    first = int(np.floor(max(0.0, min(low - 0.5, float(size)))))
    last = int(np.ceil(min(size - 1.0, max(high - 0.5, -1.0))))
    return first, last


@njit(nogil=True, cache=True)
def _nearest_faces(edges, plane, bounds, nearest, face):
    """Write 1/depth and the index of the nearest face into (H, W) images of zeros and of -1."""
    height, width = face.shape
    for f in range(edges.shape[0]):
        j0, j1 = _span(bounds[f, 0], bounds[f, 1], width)
        i0, i1 = _span(bounds[f, 2], bounds[f, 3], height)
        a0, a1, a2 = edges[f, 0, 0], edges[f, 0, 1], edges[f, 0, 2]
        b0, b1, b2 = edges[f, 1, 0], edges[f, 1, 1], edges[f, 1, 2]
        c0, c1, c2 = edges[f, 2, 0], edges[f, 2, 1], edges[f, 2, 2]
        p0, p1, p2 = plane[f, 0], plane[f, 1], plane[f, 2]
        for i in range(i0, i1 + 1):
            v = i + 0.5
            a_row, b_row, c_row, p_row = a1 * v + a2, b1 * v + b2, c1 * v + c2, p1 * v + p2
            for j in range(j0, j1 + 1):
                u = j + 0.5
                if a0 * u + a_row >= 0 and b0 * u + b_row >= 0 and c0 * u + c_row >= 0:
                    inverse_depth = p0 * u + p_row
                    if inverse_depth > nearest[i, j]:
                        nearest[i, j] = inverse_depth
                        face[i, j] = f


@njit(nogil=True, cache=True)
def _resolve(edges, depth, face, barycentric):
    """Turn 1/depth into depth in place and write the barycentric coordinates of the faces seen."""
    for i in range(face.shape[0]):
        for j in range(face.shape[1]):
            f = face[i, j]
            if f >= 0:
                u, v = j + 0.5, i + 0.5
                a = edges[f, 0, 0] * u + (edges[f, 0, 1] * v + edges[f, 0, 2])
                b = edges[f, 1, 0] * u + (edges[f, 1, 1] * v + edges[f, 1, 2])
                c = edges[f, 2, 0] * u + (edges[f, 2, 1] * v + edges[f, 2, 2])
                scale = 1.0 / (a + b + c)
                barycentric[i, j, 0] = a * scale
                barycentric[i, j, 1] = b * scale
                barycentric[i, j, 2] = c * scale
                depth[i, j] = 1.0 / depth[i, j]


@njit(nogil=True, cache=True)
def _hidden(edges, plane, bounds, uv, depth_limit):
    """(n,) bool: points behind a face. `uv` (n, 2) ascends in u."""
    hidden = np.zeros(len(uv), np.bool_)
    for f in range(edges.shape[0]):
        e = edges[f]
        for p in range(np.searchsorted(uv[:, 0], bounds[f, 0]), len(uv)):
            u, v = uv[p]
            if u > bounds[f, 1]:
                break
            if hidden[p] or v < bounds[f, 2] or v > bounds[f, 3]:
                continue
            if (
                e[0, 0] * u + e[0, 1] * v + e[0, 2] >= 0
                and e[1, 0] * u + e[1, 1] * v + e[1, 2] >= 0
                and e[2, 0] * u + e[2, 1] * v + e[2, 2] >= 0
            ):
                inverse_depth = plane[f, 0] * u + plane[f, 1] * v + plane[f, 2]
                hidden[p] = inverse_depth > 0 and inverse_depth * depth_limit[p] > 1.0
    return hidden
