"""Which points of the cloth may touch which of its triangles: the broad phase of contact.

Two lists, both grouped by triangle. The *candidates* are found on a grid with wide margins and live for many frames;
the *neighbours* are filtered out of them with narrow margins, at least once a frame. A margin is the way a vertex may
go before its list must be renewed, so fast vertices get wide margins and a calm cloth has short lists. Contact points
are the vertices and the midpoints of the edges, each written as a pair of vertices (i, i) or (i, j).
"""

import math

import numpy as np
from numba import njit

_HALF, _ONE, _ZERO = np.float32(0.5), np.float32(1), np.float32(0)
_MAX_CELLS = 1 << 15


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def find_candidates(x, margin, faces, across, points, thickness, cell, found):
    """All (triangle, point) pairs that can touch before one of their vertices leaves its margin.

    Points at a corner of the triangle, or vertices just across one of its edges, never touch it: bending keeps them
    apart.

    Args:
        x: Positions (V,3) [m].
        margin: Way each vertex may go (V,) [m].
        faces: (F,3).
        across: Opposite vertices over the edges of each face (F,3), -1 at boundaries.
        points: Vertex pair of each contact point (P,2).
        thickness: Distance at which layers touch [m].
        cell: Size of a grid cell [m].
        found: Work space for the list; replaced when too small.

    Returns:
        (starts (F+1,), found): the points of triangle t are found[starts[t]:starts[t+1]].
    """
    low, counts, inverse, ends, order, centres, reach = _sort_into_grid(x, margin, points, cell)
    widest = reach.max()
    starts = np.empty(len(faces) + 1, np.int32)
    starts[0] = 0
    n = 0
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        own = thickness + max(margin[a], margin[b], margin[c])
        r = own + widest
        lx, hx = min(x[a, 0], x[b, 0], x[c, 0]) - r, max(x[a, 0], x[b, 0], x[c, 0]) + r
        ly, hy = min(x[a, 1], x[b, 1], x[c, 1]) - r, max(x[a, 1], x[b, 1], x[c, 1]) + r
        lz, hz = min(x[a, 2], x[b, 2], x[c, 2]) - r, max(x[a, 2], x[b, 2], x[c, 2]) + r
        normal, edge_b, edge_c, height_b, height_c, height_a = frame_of(x, a, b, c)
        ix0, ix1 = max(0, int((lx - low[0]) * inverse)), min(counts[0] - 1, int((hx - low[0]) * inverse))
        iy0, iy1 = max(0, int((ly - low[1]) * inverse)), min(counts[1] - 1, int((hy - low[1]) * inverse))
        iz0, iz1 = max(0, int((lz - low[2]) * inverse)), min(counts[2] - 1, int((hz - low[2]) * inverse))
        rows = iy1 - iy0 + 1
        for row in range((iz1 - iz0 + 1) * rows):
            first = ((iz0 + row // rows) * counts[1] + iy0 + row % rows) * counts[0]
            begin = ends[first + ix0 - 1] if first + ix0 > 0 else 0
            end = ends[first + ix1]
            if n + end - begin > len(found):
                longer = np.empty(2 * len(found) + end - begin, found.dtype)
                longer[:n] = found[:n]
                found = longer
            for q in range(begin, end):
                px, py, pz = centres[q, 0] - x[a, 0], centres[q, 1] - x[a, 1], centres[q, 2] - x[a, 2]
                gap = own + reach[q]
                if abs(px * normal[0] + py * normal[1] + pz * normal[2]) > gap:
                    continue
                side = gap - thickness
                wb = px * edge_b[0] + py * edge_b[1] + pz * edge_b[2]
                wc = px * edge_c[0] + py * edge_c[1] + pz * edge_c[2]
                if wb * height_b < -side or wc * height_c < -side or (_ONE - wb - wc) * height_a < -side:
                    continue
                p = order[q]
                i, j = points[p, 0], points[p, 1]
                if i == a or i == b or i == c or j == a or j == b or j == c:
                    continue
                if i == j and (i == across[t, 0] or i == across[t, 1] or i == across[t, 2]):
                    continue
                found[n] = p
                n += 1
        starts[t + 1] = n
    return starts, found


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def keep_neighbours(x, margin, faces, points, thickness, starts, candidates, near):
    """The candidates that can touch before one of their vertices leaves its (narrow) margin.

    Args:
        x: Positions (V,3) [m].
        margin: Way each vertex may go (V,) [m].
        faces: (F,3).
        points: (P,2).
        thickness: Distance at which layers touch [m].
        starts: (F+1,) as found by `find_candidates`.
        candidates: Points of each triangle.
        near: Work space for the list; replaced when too small.

    Returns:
        (starts (F+1,), pairs (N,2)): the vertex pairs of the points near each triangle.
    """
    near_starts = np.empty(len(faces) + 1, np.int32)
    near_starts[0] = 0
    if starts[len(faces)] > len(near):
        near = np.empty((starts[len(faces)] + starts[len(faces)] // 2, 2), near.dtype)
    n = 0
    for t in range(len(faces)):
        if starts[t] < starts[t + 1]:
            a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
            own = max(margin[a], margin[b], margin[c])
            normal, edge_b, edge_c, height_b, height_c, height_a = frame_of(x, a, b, c)
            for q in range(starts[t], starts[t + 1]):
                i, j = points[candidates[q], 0], points[candidates[q], 1]
                px = _HALF * (x[i, 0] + x[j, 0]) - x[a, 0]
                py = _HALF * (x[i, 1] + x[j, 1]) - x[a, 1]
                pz = _HALF * (x[i, 2] + x[j, 2]) - x[a, 2]
                side = own + max(margin[i], margin[j])
                wb = px * edge_b[0] + py * edge_b[1] + pz * edge_b[2]
                wc = px * edge_c[0] + py * edge_c[1] + pz * edge_c[2]
                s = abs(px * normal[0] + py * normal[1] + pz * normal[2])
                inside = (wb * height_b > -side) & (wc * height_c > -side) & ((_ONE - wb - wc) * height_a > -side)
                near[n, 0], near[n, 1] = i, j
                n += inside & (s < thickness + side)
        near_starts[t + 1] = n
    return near_starts, near


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def frame_of(x, a, b, c):
    """Normal and barycentric gradients of a triangle.

    Returns:
        (unit normal, gradient of the weight of b, of c, heights over the sides opposite to b, c and a [m]).
    """
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz + np.float32(1e-16)
    area = math.sqrt(square)
    unit, scale = _ONE / area, _ONE / square
    gb = ((vy * nz - vz * ny) * scale, (vz * nx - vx * nz) * scale, (vx * ny - vy * nx) * scale)
    gc = ((ny * uz - nz * uy) * scale, (nz * ux - nx * uz) * scale, (nx * uy - ny * ux) * scale)
    sx, sy, sz = vx - ux, vy - uy, vz - uz
    height_b = area / math.sqrt(vx * vx + vy * vy + vz * vz + np.float32(1e-16))
    height_c = area / math.sqrt(ux * ux + uy * uy + uz * uz + np.float32(1e-16))
    height_a = area / math.sqrt(sx * sx + sy * sy + sz * sz + np.float32(1e-16))
    return (nx * unit, ny * unit, nz * unit), gb, gc, height_b, height_c, height_a


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def widen(v, least, horizon, most, margin):
    """Sets each vertex's margin: `least`, plus its way within the horizon [s], but not over `most` [m].

    Velocities (V,3) count relative to their mean.
    """
    n = len(v)
    mx, my, mz = mean_of(v)
    for i in range(n):
        speed = math.sqrt((v[i, 0] - mx) ** 2 + (v[i, 1] - my) ** 2 + (v[i, 2] - mz) ** 2)
        margin[i] = min(least + speed * horizon, most)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def left_margin(x, reference, margin):
    """Whether a vertex has left its margin around its reference position; motion common to all does not count."""
    n = len(x)
    mx, my, mz = _ZERO, _ZERO, _ZERO
    for i in range(n):
        mx += x[i, 0] - reference[i, 0]
        my += x[i, 1] - reference[i, 1]
        mz += x[i, 2] - reference[i, 2]
    mx /= np.float32(n)
    my /= np.float32(n)
    mz /= np.float32(n)
    worst = -_ONE
    for i in range(n):
        dx, dy, dz = x[i, 0] - reference[i, 0] - mx, x[i, 1] - reference[i, 1] - my, x[i, 2] - reference[i, 2] - mz
        worst = max(worst, dx * dx + dy * dy + dz * dz - margin[i] * abs(margin[i]))
    return worst > _ZERO


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def mean_of(v):
    """Mean of (V,3) vectors."""
    mx, my, mz = _ZERO, _ZERO, _ZERO
    for i in range(len(v)):
        mx += v[i, 0]
        my += v[i, 1]
        mz += v[i, 2]
    n = np.float32(len(v))
    return mx / n, my / n, mz / n


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _sort_into_grid(x, margin, points, cell):
    """Contact points sorted by grid cell, x fastest.

    Returns:
        (lowest corner, cells along x, y, z, 1 / cell size, end of each cell's points, point numbers in cell order, their
        positions, their margins).
    """
    low = (x[:, 0].min(), x[:, 1].min(), x[:, 2].min())
    extent = (x[:, 0].max() - low[0], x[:, 1].max() - low[1], x[:, 2].max() - low[2])
    inverse = _ONE / cell
    while (extent[0] * inverse + _ONE) * (extent[1] * inverse + _ONE) * (extent[2] * inverse + _ONE) > _MAX_CELLS:
        inverse *= np.float32(0.8)
    counts = (int(extent[0] * inverse) + 1, int(extent[1] * inverse) + 1, int(extent[2] * inverse) + 1)
    ends = np.zeros(counts[0] * counts[1] * counts[2] + 1, np.int32)
    keys = np.empty(len(points), np.int32)
    for p in range(len(points)):
        i, j = points[p, 0], points[p, 1]
        kx = int((_HALF * (x[i, 0] + x[j, 0]) - low[0]) * inverse)
        ky = int((_HALF * (x[i, 1] + x[j, 1]) - low[1]) * inverse)
        kz = int((_HALF * (x[i, 2] + x[j, 2]) - low[2]) * inverse)
        keys[p] = (kz * counts[1] + ky) * counts[0] + kx
        ends[keys[p] + 1] += 1
    for k in range(len(ends) - 1):
        ends[k + 1] += ends[k]
    order = np.empty(len(points), np.int32)
    centres = np.empty((len(points), 3), np.float32)
    reach = np.empty(len(points), np.float32)
    for p in range(len(points)):
        i, j = points[p, 0], points[p, 1]
        q = ends[keys[p]]
        ends[keys[p]] += 1
        order[q] = p
        for axis in range(3):
            centres[q, axis] = _HALF * (x[i, axis] + x[j, axis])
        reach[q] = max(margin[i], margin[j])
    return low, counts, inverse, ends, order, centres, reach
