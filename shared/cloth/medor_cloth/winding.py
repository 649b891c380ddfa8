"""Generalised winding numbers of open meshes: about 1 inside a garment, 0 outside, a smooth ramp across its openings.

W(q) = 1/4π · sum of the signed solid angles of all triangles seen from q (Jacobson et al. 2013; MEDOR, section 3.2).
On a grid the sum over all triangles is not needed: the mesh and the cone from any apex to its rims close one surface,
whose winding number is a whole number, counted by crossings along the grid's columns; the cone's share, a sum over the
few rim edges, is taken off again. Both are exact.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray


def winding_grid(vertices: NDArray[np.floating], faces: NDArray[np.integer], nodes: int = 64) -> NDArray[np.float32]:
    """Winding number at the nodes of a grid over the unit cube.

    Args:
        vertices: (V, 3) in [0, 1]³ (NOCS).
        faces: (F, 3), wound outwards.
        nodes: Nodes along each side; the first and the last lie on the cube's faces, 1 / (nodes − 1) apart.

    Returns:
        (nodes, nodes, nodes) float32, indexed [x, y, z].
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    rim = rim_edges(faces)
    apex = vertices[rim[:, 0]].mean(0) if len(rim) else np.zeros(3)
    tip = np.full((len(rim), 1), len(vertices))
    corners = np.concatenate([vertices, apex[None]])
    closed = np.concatenate([faces, np.hstack([rim[:, ::-1], tip])])
    grid = _crossings(corners[closed], nodes)
    _take_off(grid, corners[closed[len(faces) :]])
    return grid.astype(np.float32)


def winding_numbers(
    points: NDArray[np.floating], vertices: NDArray[np.floating], faces: NDArray[np.integer]
) -> NDArray[np.float32]:
    """Winding number of a mesh at any points (N, 3): the plain sum over all its triangles, (N,) float32."""
    triangles = np.asarray(vertices, np.float64)[faces]
    return _solid_angles(np.asarray(points, np.float64), triangles).astype(np.float32)


def rim_edges(faces: NDArray[np.integer]) -> NDArray[np.int64]:
    """Edges (E, 2) of one face only, in the direction their face runs through them."""
    directed = np.asarray(faces, np.int64)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = int(directed.max()) + 1
    key, twin = directed @ [size, 1], directed @ [1, size]
    return directed[~np.isin(key, twin)]


@njit(cache=True, nogil=True)
def _crossings(triangles, nodes):
    """Signed faces of a closed surface above each node (nodes, nodes, nodes)."""
    grid = np.zeros((nodes, nodes, nodes))
    step = 1.0 / (nodes - 1)
    for t in range(len(triangles)):
        corners = triangles[t]
        i0, i1 = _nodes_within(corners[:, 0], step, nodes)
        j0, j1 = _nodes_within(corners[:, 1], step, nodes)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                turn = _turns_around(corners, i * step, j * step)
                if turn != 0:
                    z = _height(corners, i * step, j * step)
                    for k in range(min(nodes, int(np.ceil(z / step)))):
                        grid[i, j, k] += turn
    return grid


@njit(cache=True, nogil=True)
def _nodes_within(values, step, nodes):
    return max(0, int(np.floor(values.min() / step))), min(nodes - 1, int(np.ceil(values.max() / step)))


@njit(cache=True, nogil=True)
def _turns_around(corners, x, y):
    """How a triangle runs around a column: 1 counterclockwise (facing up), −1 clockwise, 0 not at all.

    Neighbouring triangles evaluate their common edge alike, so that no column slips between them.
    """
    turns = 0
    for k in range(3):
        a, b = corners[k], corners[(k + 1) % 3]
        low, high, sign = (a, b, 1) if a[1] <= b[1] else (b, a, -1)
        if low[1] <= y < high[1] and (high[0] - low[0]) * (y - low[1]) > (x - low[0]) * (high[1] - low[1]):
            turns += sign
    return turns


@njit(cache=True, nogil=True)
def _height(corners, x, y):
    """Height of a triangle's plane over (x, y)."""
    a, b, c = corners[0], corners[1], corners[2]
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    to_b = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area
    to_c = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area
    return a[2] + to_b * (b[2] - a[2]) + to_c * (c[2] - a[2])


@njit(cache=True, nogil=True)
def _take_off(grid, triangles):
    """Subtract the winding numbers of triangles from all nodes, in place."""
    nodes = len(grid)
    step = 1.0 / (nodes - 1)
    column = np.empty((nodes, 3))
    column[:, 2] = np.arange(nodes) * step
    for i in range(nodes):
        column[:, 0] = i * step
        for j in range(nodes):
            column[:, 1] = j * step
            grid[i, j] -= _solid_angles(column, triangles)


@njit(cache=True, nogil=True)
def _solid_angles(points, triangles):
    """Winding numbers (N,) of triangles (T, 3, 3): each solid angle by van Oosterom and Strackee (1983)."""
    winding = np.zeros(len(points))
    for n in range(len(points)):
        px, py, pz = points[n, 0], points[n, 1], points[n, 2]
        total = 0.0
        for t in range(len(triangles)):
            ax, ay, az = triangles[t, 0, 0] - px, triangles[t, 0, 1] - py, triangles[t, 0, 2] - pz
            bx, by, bz = triangles[t, 1, 0] - px, triangles[t, 1, 1] - py, triangles[t, 1, 2] - pz
            cx, cy, cz = triangles[t, 2, 0] - px, triangles[t, 2, 1] - py, triangles[t, 2, 2] - pz
            a, b, c = np.sqrt(ax**2 + ay**2 + az**2), np.sqrt(bx**2 + by**2 + bz**2), np.sqrt(cx**2 + cy**2 + cz**2)
            volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            cosines = (ax * bx + ay * by + az * bz) * c + (bx * cx + by * cy + bz * cz) * a
            total += np.arctan2(volume, a * b * c + cosines + (cx * ax + cy * ay + cz * az) * b)
        winding[n] = total / (2 * np.pi)
    return winding
