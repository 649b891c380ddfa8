"""The frame loop of the solver: substeps of prediction, springs, contact and velocity update (XPBD)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from medor_cloth.cloth import Springs
from medor_cloth.contact import damp_contacts, part_layers, rest_on_table
from medor_cloth.grasp import nearest_within_reach
from medor_cloth.kernel import kernel
from medor_cloth.proximity import expect, find_neighbours, n_astray
from medor_cloth.springs import damp_springs, relax_springs

FRAME_S = 0.01
"""Duration of one frame [s]."""
CALM_FRAMES = 3
"""Frames in a row after which a slow cloth counts as settled."""

_ZERO, _ONE = np.float32(0), np.float32(1)
_DAMPED_EVERY = 4
_CALM_SHARE = 200
"""One in so many vertices may be faster than the settled speed."""


class Topology(NamedTuple):
    """The cloth as the kernels see it."""

    faces: NDArray[np.int32]
    across: NDArray[np.int32]
    stretch: Springs
    bend: Springs
    points: NDArray[np.int32]
    areas: NDArray[np.float32]
    squares: NDArray[np.float32]


class Physics(NamedTuple):
    """The constants as the kernels see them, in float32 and per substep where they belong to one."""

    substeps: int
    spring_passes: int
    step: np.float32
    gravity: np.float32
    drag: np.float32
    top_speed: np.float32
    thickness: np.float32
    table_friction: np.float32
    layer_friction: np.float32
    push_out: np.float32
    bend_compliance: np.float32
    compression: np.float32
    spring_damping: np.float32
    contact_damping: np.float32
    settle_speed: np.float32
    cell: np.float32
    least_margin: np.float32
    horizon: np.float32
    stray: np.float32
    most_margin: np.float32


@kernel
def simulate(x, v, picker, path, holding, held, calm, topology: Topology, physics: Physics):
    """Moves the cloth through the frames of a picker path, or until it has settled.

    Args:
        x: Positions (V,3) [m], changed in place, as are velocities and picker.
        v: Velocities (V,3) [m/s].
        picker: Position (3,) [m].
        path: Picker position at the end of each frame (T,3) [m].
        holding: Whether the picker is closed in each frame (T,).
        held: Vertex in the picker, -1 for none.
        calm: Frames the cloth has been slow for.
        topology: The cloth.
        physics: The constants.

    Returns:
        (frames done, held, calm).
    """
    n = len(x)
    inverse_mass = np.ones(n, np.float32)
    before, start = np.empty_like(x), np.empty(3, np.float32)
    longest = max(_longest(topology.stretch.colours), _longest(topology.bend.colours))
    scratch = np.empty((4, longest), np.float32)
    faces, points, thickness = topology.faces, topology.points, physics.thickness
    expected, margin = np.empty_like(x), np.empty(n, np.float32)
    starts, near = np.empty(0, np.int32), np.empty((4 * len(points), 2), np.int32)
    corners, weights = np.empty((0, 5), np.int32), np.empty((0, 6), np.float32)
    for frame in range(len(path)):
        held = (held if held >= 0 else nearest_within_reach(x, picker)) if holding[frame] else -1
        if held >= 0:
            inverse_mass[held] = _ZERO
            start[:] = x[held]
        for substep in range(physics.substeps):
            _predict(x, v, before, inverse_mass, physics)
            if held >= 0:
                share = np.float32(substep + 1) / np.float32(physics.substeps)
                for axis in range(3):
                    x[held, axis] = start[axis] + share * (path[frame, axis] - picker[axis])
                x[held, 2] = max(x[held, 2], thickness * np.float32(0.5))
            relax_springs(x, inverse_mass, topology.bend, physics.bend_compliance, _ONE, scratch)
            for _ in range(physics.spring_passes):
                relax_springs(x, inverse_mass, topology.stretch, _ZERO, physics.compression, scratch)
            if substep == 0 or n_astray(x, expected, margin) > physics.stray * n:
                expect(x, v, physics.horizon, physics.least_margin, physics.most_margin, expected, margin)
                starts, near = find_neighbours(
                    expected, margin, faces, topology.across, points, thickness, physics.cell, near
                )
                if len(corners) < len(near):
                    corners, weights = np.empty((len(near), 5), np.int32), np.empty((len(near), 6), np.float32)
            touching = part_layers(
                x,
                before,
                inverse_mass,
                faces,
                topology.areas,
                topology.squares,
                starts,
                near,
                thickness,
                physics.layer_friction,
                physics.push_out,
                corners,
                weights,
            )
            rest_on_table(x, before, inverse_mass, thickness * np.float32(0.5), physics.table_friction)
            _update_velocity(x, v, before, physics.step)
            if substep % _DAMPED_EVERY == _DAMPED_EVERY - 1:
                damp_springs(x, v, inverse_mass, topology.bend.pairs, physics.spring_damping)
                damp_springs(x, v, inverse_mass, topology.stretch.pairs, physics.spring_damping)
                damp_contacts(v, inverse_mass, corners, weights, touching, physics.contact_damping)
        if held >= 0:
            inverse_mass[held] = _ONE
        picker[:] = path[frame]
        calm = calm + 1 if physics.settle_speed > _ZERO and _is_slow(v, physics.settle_speed) else 0
        if calm >= CALM_FRAMES:
            return frame + 1, held, calm
    return len(path), held, calm


@kernel
def _predict(x, v, before, inverse_mass, physics: Physics):
    """Free flight of every vertex that is not held, no faster than the top speed."""
    step, keep = physics.step, _ONE - physics.drag * physics.step
    fall = physics.gravity * step
    limit = physics.top_speed * physics.top_speed
    for i in range(len(x)):
        before[i, 0], before[i, 1], before[i, 2] = x[i, 0], x[i, 1], x[i, 2]
        if inverse_mass[i] > _ZERO:
            vx, vy, vz = v[i, 0] * keep, v[i, 1] * keep, (v[i, 2] - fall) * keep
            square = vx * vx + vy * vy + vz * vz
            way = step if square <= limit else step * physics.top_speed / math.sqrt(square)
            x[i, 0] += way * vx
            x[i, 1] += way * vy
            x[i, 2] += way * vz


@kernel
def _update_velocity(x, v, before, step):
    rate = _ONE / step
    for i in range(len(x)):
        for axis in range(3):
            v[i, axis] = (x[i, axis] - before[i, axis]) * rate


@kernel
def _is_slow(v, speed):
    fast = 0
    for i in range(len(v)):
        if v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1] + v[i, 2] * v[i, 2] > speed * speed:
            fast += 1
    return fast * _CALM_SHARE <= len(v)


@kernel
def _longest(colours):
    longest = 0
    for c in range(len(colours) - 1):
        longest = max(longest, colours[c + 1] - colours[c])
    return longest
