"""Which points of the cloth may touch which of its triangles: the broad phase of contact.

Contact points are the vertices and the midpoints of the edges, each written as a pair of vertices (i, i) or (i, j). The
pairs are listed by triangle, once a frame, around the places where the vertices are expected in the middle of the
frame. A list holds until vertices leave their margins around these places; margins follow speed, so the list of a calm
cloth is short.
"""

import math

import numpy as np

from medor_cloth.kernel import kernel

_HALF, _ONE, _ZERO, _TINY = np.float32(0.5), np.float32(1), np.float32(0), np.float32(1e-16)
_MAX_CELLS = 1 << 15
_FINE, _LOW = np.float32(4), np.float32(0.08)
"""Cells are narrow along x, along which they are read in one go, and high: piles of cloth are low."""
_LANES = 16
"""Points measured at once; arrays of points are longer by as many."""
_RIM = np.float32(0.0015)
"""How far beside a triangle points are listed [m]."""
_TILT = np.float32(0.3)
"""Points beside the rim, or over a triangle that turns, are off by this share of the thickness along each axis."""


@kernel
def find_neighbours(x, margin, faces, across, points, thickness, cell, near):
    """All (triangle, point) pairs that can touch before one of their vertices leaves its margin.

    Points at a corner of the triangle, and vertices just across one of its edges, never touch it: bending keeps them
    apart.

    Args:
        x: Expected positions (V,3) [m].
        margin: Way each vertex may go from there (V,) [m].
        faces: (F,3).
        across: Opposite vertices over the edges of each face (F,3), -1 at boundaries.
        points: Vertex pair of each contact point (P,2).
        thickness: Distance at which layers touch [m].
        cell: Size of a grid cell [m].
        near: Work space for the list; replaced when too small.

    Returns:
        (starts (F+1,), near (N,2)): the points near triangle t are near[starts[t]:starts[t+1]].
    """
    low, counts, inverse_x, inverse_y, inverse_z, ends, order, px, py, pz, reach = _sort_into_grid(
        x, margin, points, cell
    )
    widest = reach.max()
    starts = np.empty(len(faces) + 1, np.int32)
    starts[0] = 0
    gap = np.empty(_LANES, np.float32)
    close = np.empty(len(points) + 1, np.int32)
    n = 0
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay, az = x[a, 0], x[a, 1], x[a, 2]
        ux, uy, uz = x[b, 0] - ax, x[b, 1] - ay, x[b, 2] - az
        vx, vy, vz = x[c, 0] - ax, x[c, 1] - ay, x[c, 2] - az
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area = math.sqrt(nx * nx + ny * ny + nz * nz + _TINY)
        nx, ny, nz = nx / area, ny / area, nz / area
        # Within the plane of the triangle: directions away from its sides at b and c, and what adds up to that at a.
        length_b = math.sqrt(vx * vx + vy * vy + vz * vz + _TINY)
        length_c = math.sqrt(ux * ux + uy * uy + uz * uz + _TINY)
        length_a = math.sqrt((vx - ux) ** 2 + (vy - uy) ** 2 + (vz - uz) ** 2 + _TINY)
        bx, by, bz = (vz * ny - vy * nz) / length_b, (vx * nz - vz * nx) / length_b, (vy * nx - vx * ny) / length_b
        cx, cy, cz = (uy * nz - uz * ny) / length_c, (uz * nx - ux * nz) / length_c, (ux * ny - uy * nx) / length_c
        share_b, share_c, height = -length_b / length_a, -length_c / length_a, area / length_a
        own = max(margin[a], margin[b], margin[c])
        level, rim = thickness + own, _RIM + own
        # A touching point lies over the triangle: it is off by the thickness along the normal, which may tilt.
        rx = thickness * max(abs(nx), _TILT) + own + widest
        ry = thickness * max(abs(ny), _TILT) + own + widest
        rz = thickness * max(abs(nz), _TILT) + own + widest
        ix0 = max(0, int((min(ax, x[b, 0], x[c, 0]) - rx - low[0]) * inverse_x))
        iy0 = max(0, int((min(ay, x[b, 1], x[c, 1]) - ry - low[1]) * inverse_y))
        iz0 = max(0, int((min(az, x[b, 2], x[c, 2]) - rz - low[2]) * inverse_z))
        ix1 = min(counts[0] - 1, int((max(ax, x[b, 0], x[c, 0]) + rx - low[0]) * inverse_x))
        iy1 = min(counts[1] - 1, int((max(ay, x[b, 1], x[c, 1]) + ry - low[1]) * inverse_y))
        iz1 = min(counts[2] - 1, int((max(az, x[b, 2], x[c, 2]) + rz - low[2]) * inverse_z))
        m = 0
        for iz in range(iz0, iz1 + 1):
            for iy in range(iy0, iy1 + 1):
                row = (iz * counts[1] + iy) * counts[0]
                first = ends[row + ix0 - 1] if row + ix0 > 0 else 0
                last = ends[row + ix1]
                for block in range(first, last, _LANES):
                    for lane in range(_LANES):  # of constant length and without branches, so that it is vectorised
                        q = block + lane
                        gx, gy, gz = px[q] - ax, py[q] - ay, pz[q] - az
                        beyond_b, beyond_c = gx * bx + gy * by + gz * bz, gx * cx + gy * cy + gz * cz
                        beyond_a = share_b * beyond_b + share_c * beyond_c - height
                        beyond = max(beyond_a, max(beyond_b, beyond_c)) - rim
                        gap[lane] = max(abs(gx * nx + gy * ny + gz * nz) - level, beyond) - reach[q]
                    for lane in range(min(_LANES, last - block)):
                        close[m] = block + lane
                        m += gap[lane] < _ZERO
        if n + m > len(near):
            longer = np.empty((2 * len(near) + m, 2), near.dtype)
            longer[:n] = near[:n]
            near = longer
        for k in range(m):
            i, j = points[order[close[k]], 0], points[order[close[k]], 1]
            corner = (i == a) | (i == b) | (i == c) | (j == a) | (j == b) | (j == c)
            hinge = (i == j) & ((i == across[t, 0]) | (i == across[t, 1]) | (i == across[t, 2]))
            near[n, 0], near[n, 1] = i, j
            n += not (corner | hinge)
        starts[t + 1] = n
    return starts, near


@kernel
def expect(x, v, horizon, least, most, expected, margin):
    """Sets where each vertex is expected in the middle of the horizon [s], and how far from there it may go [m].

    The margin is `least`, plus half the way within the horizon, but not over `most`. Way and speed count relative to
    the mean of all vertices.
    """
    n = len(v)
    mx, my, mz = _ZERO, _ZERO, _ZERO
    for i in range(n):
        mx += v[i, 0]
        my += v[i, 1]
        mz += v[i, 2]
    mx, my, mz = mx / np.float32(n), my / np.float32(n), mz / np.float32(n)
    half = _HALF * horizon
    for i in range(n):
        wx, wy, wz = half * (v[i, 0] - mx), half * (v[i, 1] - my), half * (v[i, 2] - mz)
        way = math.sqrt(wx * wx + wy * wy + wz * wz)
        share = min(_ONE, most / (way + _TINY))
        expected[i, 0], expected[i, 1], expected[i, 2] = (
            x[i, 0] + share * wx,
            x[i, 1] + share * wy,
            x[i, 2] + share * wz,
        )
        margin[i] = least + share * way


@kernel
def n_astray(x, expected, margin):
    """Number of vertices that have left their margin; motion common to all does not count."""
    n = len(x)
    mx, my, mz = _ZERO, _ZERO, _ZERO
    for i in range(n):
        mx += x[i, 0] - expected[i, 0]
        my += x[i, 1] - expected[i, 1]
        mz += x[i, 2] - expected[i, 2]
    mx, my, mz = mx / np.float32(n), my / np.float32(n), mz / np.float32(n)
    astray = 0
    for i in range(n):
        dx, dy, dz = x[i, 0] - expected[i, 0] - mx, x[i, 1] - expected[i, 1] - my, x[i, 2] - expected[i, 2] - mz
        astray += dx * dx + dy * dy + dz * dz > margin[i] * margin[i]
    return astray


@kernel
def _sort_into_grid(x, margin, points, cell):
    """Contact points sorted by grid cell, x fastest.

    Returns:
        (lowest corner, cells along x, y, z, 1 / cell size, end of each cell's points, then in cell order the point
        numbers, their three coordinates and their margins).
    """
    low = (x[:, 0].min(), x[:, 1].min(), x[:, 2].min())
    extent = (x[:, 0].max() - low[0], x[:, 1].max() - low[1], x[:, 2].max() - low[2])
    inverse_x, inverse_y, inverse_z = _FINE / cell, _ONE / cell, _LOW / cell
    while (extent[0] * inverse_x + 2) * (extent[1] * inverse_y + 2) * (extent[2] * inverse_z + 2) > _MAX_CELLS:
        inverse_x *= np.float32(0.8)
        inverse_y *= np.float32(0.8)
        inverse_z *= np.float32(0.8)
    # One cell to spare: rounding may put the outermost point past the last.
    counts = (int(extent[0] * inverse_x) + 2, int(extent[1] * inverse_y) + 2, int(extent[2] * inverse_z) + 2)
    ends = np.zeros(counts[0] * counts[1] * counts[2] + 1, np.int32)
    keys = np.empty(len(points), np.int32)
    for p in range(len(points)):
        i, j = points[p, 0], points[p, 1]
        kx = int((_HALF * (x[i, 0] + x[j, 0]) - low[0]) * inverse_x)
        ky = int((_HALF * (x[i, 1] + x[j, 1]) - low[1]) * inverse_y)
        kz = int((_HALF * (x[i, 2] + x[j, 2]) - low[2]) * inverse_z)
        keys[p] = (kz * counts[1] + ky) * counts[0] + kx
        ends[keys[p] + 1] += 1
    for k in range(len(ends) - 1):
        ends[k + 1] += ends[k]
    order = np.empty(len(points), np.int32)
    size = len(points) + _LANES
    px, py, pz = np.zeros(size, np.float32), np.zeros(size, np.float32), np.zeros(size, np.float32)
    reach = np.zeros(size, np.float32)
    for p in range(len(points)):
        i, j = points[p, 0], points[p, 1]
        q = ends[keys[p]]
        ends[keys[p]] += 1
        order[q] = p
        px[q], py[q], pz[q] = _HALF * (x[i, 0] + x[j, 0]), _HALF * (x[i, 1] + x[j, 1]), _HALF * (x[i, 2] + x[j, 2])
        reach[q] = max(margin[i], margin[j])
    return low, counts, inverse_x, inverse_y, inverse_z, ends, order, px, py, pz, reach
