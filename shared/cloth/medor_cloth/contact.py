"""Contact of the cloth with itself and with the table, with Coulomb friction by projection."""

import math

import numpy as np

from medor_cloth.kernel import kernel

_ONE, _HALF, _QUARTER, _ZERO = np.float32(1), np.float32(0.5), np.float32(0.25), np.float32(0)
_CRUSHED, _TORN = np.float32(0.5), np.float32(1.12)
"""A face below this share of its rest area, or with sides longer than this multiple at rest, touches nothing.

Whole cloth is never so distorted. Only in a tangle do contacts pull faces out of shape; letting go of them lets the
layers slip apart, where pushing on would tear the tangle wider.
"""
_RIM = np.float32(-0.02)
"""How far outside a triangle, in barycentric weight, a point still counts as over it."""


@kernel
def part_layers(x, before, inverse_mass, faces, areas, squares, starts, near, thickness, friction, push_out):
    """Pushes every point closer than the thickness to a triangle back to the side it was on before this substep.

    The side is never remembered longer, so that a tangle is not locked in.

    Args:
        x: Positions (V,3) [m], changed in place.
        before: Positions at the start of the substep (V,3) [m].
        inverse_mass: (V,), 0 for a held vertex.
        faces: (F,3).
        areas: Rest area of each face (F,) [m²].
        squares: Sum of the squared rest lengths of each face's sides (F,) [m²].
        starts: (F+1,) first point of each triangle.
        near: Vertex pair of each point (N,2).
        thickness: Distance kept between layers [m].
        friction: Coulomb coefficient between layers.
        push_out: Largest separating motion in one substep [m].
    """
    for t in range(len(faces)):
        if starts[t] == starts[t + 1]:
            continue
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay, az = x[a, 0], x[a, 1], x[a, 2]
        bx, by, bz = x[b, 0], x[b, 1], x[b, 2]
        cx, cy, cz = x[c, 0], x[c, 1], x[c, 2]
        ux, uy, uz = bx - ax, by - ay, bz - az
        vx, vy, vz = cx - ax, cy - ay, cz - az
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        square = nx * nx + ny * ny + nz * nz
        dot = ux * vx + uy * vy + uz * vz
        sides = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz
        crushed = square < np.float32(4) * (_CRUSHED * areas[t]) ** 2
        if crushed or sides + sides - dot - dot > _TORN * _TORN * squares[t]:
            continue
        unit = _ONE / math.sqrt(square)
        nx, ny, nz = nx * unit, ny * unit, nz * unit
        touched = False
        for q in range(starts[t], starts[t + 1]):
            i, j = near[q, 0], near[q, 1]
            px, py, pz = _HALF * (x[i, 0] + x[j, 0]), _HALF * (x[i, 1] + x[j, 1]), _HALF * (x[i, 2] + x[j, 2])
            gx, gy, gz = px - ax, py - ay, pz - az
            s = gx * nx + gy * ny + gz * nz
            if abs(s) >= thickness:  # no point crosses a whole thickness within a substep
                continue
            lc = ((uy * gz - uz * gy) * nx + (uz * gx - ux * gz) * ny + (ux * gy - uy * gx) * nz) * unit
            lb = ((gy * vz - gz * vy) * nx + (gz * vx - gx * vz) * ny + (gx * vy - gy * vx) * nz) * unit
            la = _ONE - lb - lc
            if la < _RIM or lb < _RIM or lc < _RIM:
                continue
            side = _side(before, a, b, c, i, j)
            depth = thickness - s * side
            # Motion of the point relative to the triangle during this substep: normal part, then tangential.
            wx = px - _HALF * (before[i, 0] + before[j, 0])
            wy = py - _HALF * (before[i, 1] + before[j, 1])
            wz = pz - _HALF * (before[i, 2] + before[j, 2])
            wx -= la * (ax - before[a, 0]) + lb * (bx - before[b, 0]) + lc * (cx - before[c, 0])
            wy -= la * (ay - before[a, 1]) + lb * (by - before[b, 1]) + lc * (cy - before[c, 1])
            wz -= la * (az - before[a, 2]) + lb * (bz - before[b, 2]) + lc * (cz - before[c, 2])
            normal = (wx * nx + wy * ny + wz * nz) * side
            push = min(depth, push_out - normal)
            wi, wj = inverse_mass[i], inverse_mass[j]
            wa, wb, wc = inverse_mass[a] * la, inverse_mass[b] * lb, inverse_mass[c] * lc
            total = (wi if i == j else _QUARTER * (wi + wj)) + wa * la + wb * lb + wc * lc
            if push <= _ZERO or total < np.float32(1e-9):
                continue
            normal *= side
            wx, wy, wz = wx - normal * nx, wy - normal * ny, wz - normal * nz
            slip = math.sqrt(wx * wx + wy * wy + wz * wz) + np.float32(1e-9)
            drag = min(_ONE, friction * push / slip)
            push *= side
            total = _ONE / total
            dx, dy, dz = (
                (push * nx - drag * wx) * total,
                (push * ny - drag * wy) * total,
                (push * nz - drag * wz) * total,
            )
            hi, hj = _HALF * wi, _HALF * wj
            x[i, 0] += hi * dx
            x[i, 1] += hi * dy
            x[i, 2] += hi * dz
            x[j, 0] += hj * dx
            x[j, 1] += hj * dy
            x[j, 2] += hj * dz
            ax, ay, az = ax - wa * dx, ay - wa * dy, az - wa * dz
            bx, by, bz = bx - wb * dx, by - wb * dy, bz - wb * dz
            cx, cy, cz = cx - wc * dx, cy - wc * dy, cz - wc * dz
            touched = True
        if touched:
            x[a, 0], x[a, 1], x[a, 2] = ax, ay, az
            x[b, 0], x[b, 1], x[b, 2] = bx, by, bz
            x[c, 0], x[c, 1], x[c, 2] = cx, cy, cz


@kernel
def rest_on_table(x, before, inverse_mass, height, friction):
    """Keeps every vertex at least `height` over the table plane z = 0 and holds it back by friction."""
    for i in range(len(x)):
        depth = height - x[i, 2]
        if depth > _ZERO and inverse_mass[i] > _ZERO:
            x[i, 2] = height
            wx, wy = x[i, 0] - before[i, 0], x[i, 1] - before[i, 1]
            drag = min(_ONE, friction * depth / (math.sqrt(wx * wx + wy * wy) + np.float32(1e-9)))
            x[i, 0] -= drag * wx
            x[i, 1] -= drag * wy


@kernel
def _side(before, a, b, c, i, j):
    """+1 if the midpoint of i and j was on the triangle's outer side, else -1."""
    ax, ay, az = before[a, 0], before[a, 1], before[a, 2]
    ux, uy, uz = before[b, 0] - ax, before[b, 1] - ay, before[b, 2] - az
    vx, vy, vz = before[c, 0] - ax, before[c, 1] - ay, before[c, 2] - az
    gx = _HALF * (before[i, 0] + before[j, 0]) - ax
    gy = _HALF * (before[i, 1] + before[j, 1]) - ay
    gz = _HALF * (before[i, 2] + before[j, 2]) - az
    s = gx * (uy * vz - uz * vy) + gy * (uz * vx - ux * vz) + gz * (ux * vy - uy * vx)
    return _ONE if s >= _ZERO else -_ONE
