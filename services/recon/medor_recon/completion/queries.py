"""Points at which the fields are learnt: anywhere in the NOCS cube, and on or near the garment's surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from medor_recon.completion.augment import Example

VOLUME = 6000
SURFACE = 6000
PUSH = 0.01
"""Spread of the distance from the surface of every other surface query, in the NOCS cube: the mesh that the warp is
read at lies off the surface by as much."""


@dataclass(frozen=True, eq=False)
class Queries:
    """Queries of one example and what is true there.

    Attributes:
        volume: (N, 3) float32 in the NOCS cube.
        winding: (N,) float32 winding numbers there.
        surface: (M, 3) float32 in the NOCS cube.
        positions: (M, 3) float32 where these points are, world frame [m].
    """

    volume: NDArray[np.float32]
    winding: NDArray[np.float32]
    surface: NDArray[np.float32]
    positions: NDArray[np.float32]


def queries(
    item: Example, winding: NDArray[np.floating], rng: np.random.Generator, volume: int = VOLUME, surface: int = SURFACE
) -> Queries:
    """Draw queries.

    Args:
        winding: (N, N, N) winding numbers of the garment, before the example's turn.
    """
    anywhere = rng.random((volume, 3), np.float32)
    nocs, positions = on_surface(item, rng, surface)
    return Queries(anywhere, winding_at(winding, item.turn.back(anywhere)), nocs, positions)


def winding_at(winding: NDArray[np.floating], points: NDArray[np.floating]) -> NDArray[np.float32]:
    """A grid of winding numbers between its nodes, trilinear, at points (Q, 3) of the NOCS cube."""
    nodes = points.T * (len(winding) - 1)
    return np.asarray(map_coordinates(winding.astype(np.float32), nodes, order=1, mode="nearest"), np.float32)


def on_surface(
    item: Example, rng: np.random.Generator, number: int, push: float = PUSH
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Points spread evenly over the canonical surface, every other one off it by `push`, and their positions."""
    corners = item.nocs[item.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    face = rng.choice(len(area), number, p=area / area.sum())
    u, v = rng.random((2, number, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    weights = np.stack([1 - u - v, u, v], axis=1)
    off = rng.normal(0, push, (number, 1)) * (np.arange(number) % 2)[:, None]
    nocs = (weights * corners[face]).sum(axis=1) + off * normal[face] / area[face, None]
    positions = (weights * item.positions[item.faces[face]]).sum(axis=1)
    return nocs.astype(np.float32), positions.astype(np.float32)
