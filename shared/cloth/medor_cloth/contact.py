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
_RIM = np.float32(-0.15)
"""How far outside a triangle, in barycentric weight, a point still touches it, ever less: a point that slides over the
rim of a triangle must not be thrown out by a whole thickness at once."""


@kernel
def part_layers(
    x, before, inverse_mass, faces, areas, squares, starts, near, thickness, friction, push_out, corners, weights
):
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
        corners: Written: the vertices i, j, a, b, c of every contact that pushed (N,5).
        weights: Written: barycentric weights of the triangle's corners and the normal of every such contact (N,6).

    Returns:
        Number of contacts that pushed.
    """
    n = 0
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
            beyond = min(la, min(lb, lc))
            if beyond < _RIM:
                continue
            side = _side(before, a, b, c, i, j)
            depth = thickness * min(_ONE, _ONE - beyond / _RIM) - s * side
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
            corners[n, 0], corners[n, 1], corners[n, 2], corners[n, 3], corners[n, 4] = i, j, a, b, c
            weights[n, 0], weights[n, 1], weights[n, 2] = la, lb, lc
            weights[n, 3], weights[n, 4], weights[n, 5] = nx, ny, nz
            n += 1
            touched = True
        if touched:
            x[a, 0], x[a, 1], x[a, 2] = ax, ay, az
            x[b, 0], x[b, 1], x[b, 2] = bx, by, bz
            x[c, 0], x[c, 1], x[c, 2] = cx, cy, cz
    return n


@kernel
def damp_contacts(v, inverse_mass, corners, weights, n, share):
    """Takes a share of the relative velocity along the normal of every contact away; momentum is kept.

    Layers that lie on each other would otherwise tremble between springs that press and contacts that push.

    Args:
        v: Velocities (V,3) [m/s], changed in place.
        inverse_mass: (V,), 0 for a held vertex.
        corners: Vertices i, j, a, b, c of the contacts (N,5).
        weights: Barycentric weights of the triangle's corners and the normal (N,6).
        n: Number of contacts.
        share: Share taken away.
    """
    for k in range(n):
        i, j, a, b, c = corners[k, 0], corners[k, 1], corners[k, 2], corners[k, 3], corners[k, 4]
        la, lb, lc = weights[k, 0], weights[k, 1], weights[k, 2]
        wi, wj = _HALF * inverse_mass[i], _HALF * inverse_mass[j]
        wa, wb, wc = inverse_mass[a] * la, inverse_mass[b] * lb, inverse_mass[c] * lc
        total = wa * la + wb * lb + wc * lc + (inverse_mass[i] if i == j else _HALF * (wi + wj))
        rate = _ZERO
        for axis in range(3):
            triangle = la * v[a, axis] + lb * v[b, axis] + lc * v[c, axis]
            rate += weights[k, 3 + axis] * (_HALF * (v[i, axis] + v[j, axis]) - triangle)
        rate *= share / (total + np.float32(1e-9))
        for axis in range(3):
            change = rate * weights[k, 3 + axis]
            v[i, axis] -= wi * change
            v[j, axis] -= wj * change
            v[a, axis] += wa * change
            v[b, axis] += wb * change
            v[c, axis] += wc * change


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
