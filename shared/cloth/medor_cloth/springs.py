"""Springs of the solver: stretching and bending as distance constraints, and the damping along them."""

import math

import numpy as np

from medor_cloth.cloth import Springs
from medor_cloth.kernel import kernel

_ONE, _ZERO, _TINY = np.float32(1), np.float32(0), np.float32(1e-12)


@kernel
def relax_springs(x, inverse_mass, springs: Springs, compliance, compression, scratch):
    """Moves vertices towards the rest length of every spring, one colour after the other (XPBD, one iteration).

    Args:
        x: Positions (V,3) [m], changed in place.
        inverse_mass: (V,), 0 for a held vertex.
        springs: The springs, by colour.
        compliance: XPBD compliance over the squared time step.
        compression: Share of the correction that a shortened spring gets; cloth buckles rather than resists.
        scratch: Work space (4, springs of the largest colour).
    """
    pairs, rest, colours = springs.pairs, springs.rest_lengths, springs.colours
    dx, dy, dz, weight = scratch[0], scratch[1], scratch[2], scratch[3]
    for c in range(len(colours) - 1):
        start = colours[c]
        n = colours[c + 1] - start
        for k in range(n):
            i, j = pairs[start + k, 0], pairs[start + k, 1]
            dx[k], dy[k], dz[k] = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
            weight[k] = inverse_mass[i] + inverse_mass[j]
        for k in range(n):  # without gathers, so that it is vectorised
            length = math.sqrt(dx[k] * dx[k] + dy[k] * dy[k] + dz[k] * dz[k] + _TINY)
            stretch = rest[start + k] - length
            stretch *= compression if stretch > _ZERO else _ONE
            stretch /= (weight[k] + compliance + _TINY) * length
            dx[k] *= stretch
            dy[k] *= stretch
            dz[k] *= stretch
        for k in range(n):
            i, j = pairs[start + k, 0], pairs[start + k, 1]
            wi, wj = inverse_mass[i], inverse_mass[j]
            x[i, 0] += wi * dx[k]
            x[i, 1] += wi * dy[k]
            x[i, 2] += wi * dz[k]
            x[j, 0] -= wj * dx[k]
            x[j, 1] -= wj * dy[k]
            x[j, 2] -= wj * dz[k]


@kernel
def damp_springs(x, v, inverse_mass, pairs, share):
    """Takes a share of the relative velocity along every spring away; momentum is kept.

    Args:
        x: Positions (V,3) [m].
        v: Velocities (V,3) [m/s], changed in place.
        inverse_mass: (V,), 0 for a held vertex.
        pairs: Vertices of the springs (E,2).
        share: Share taken away.
    """
    for e in range(len(pairs)):
        i, j = pairs[e, 0], pairs[e, 1]
        wi, wj = inverse_mass[i], inverse_mass[j]
        dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
        ux, uy, uz = v[i, 0] - v[j, 0], v[i, 1] - v[j, 1], v[i, 2] - v[j, 2]
        weight = (dx * dx + dy * dy + dz * dz) * (wi + wj) + _TINY
        rate = share * (dx * ux + dy * uy + dz * uz) / weight
        v[i, 0] -= wi * rate * dx
        v[i, 1] -= wi * rate * dy
        v[i, 2] -= wi * rate * dz
        v[j, 0] += wj * rate * dx
        v[j, 1] += wj * rate * dy
        v[j, 2] += wj * rate * dz
