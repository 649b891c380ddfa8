"""Stages that know the truth, to measure the others before, or without, their networks."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.completion.fill import fill
from medor_recon.completion.pixels import thinned
from medor_recon.evaluate.observed import Observed

WAVES = 6
WAVE_M = 0.2
"""Length of the smooth error's waves on the table [m]."""
FED_M = 0.008
"""Distance of the pixels that are filled from [m]."""


def canonicalized(observed: Observed, noise: float, bend: float, rng: np.random.Generator) -> Canonicalized:
    """The true canonical coordinates with errors.

    Args:
        observed: of this view.
        noise: spread of each pixel's own error, along each axis, in the NOCS cube.
        bend: spread of an error that is smooth over the view, as networks make.
        rng: source of all randomness.
    """
    seen = observed.truth
    error = noise * rng.standard_normal(seen.nocs.shape) + bend * _smooth(seen.points, rng)
    return replace(seen, nocs=np.clip(seen.nocs + error, 0, 1).astype(np.float32))


def completed(observed: Observed, seen: Canonicalized) -> Completed:
    """The true shape, laid out by inverse distance weighting of the visible points: nothing learnt."""
    garment = observed.garment
    filled = fill(thinned(seen, FED_M), garment.vertices, softness=0.005)
    return Completed(garment.vertices, garment.faces, filled.positions)


def _smooth(points: NDArray[np.floating], rng: np.random.Generator) -> NDArray[np.float64]:
    """(P, 3) smooth functions of the place on the table, of root mean square 1 along each axis."""
    ways = rng.standard_normal((WAVES, 2)) * (2 * np.pi / WAVE_M)
    waves = np.sin(points[:, :2] @ ways.T + rng.uniform(0, 2 * np.pi, WAVES)) @ rng.standard_normal((WAVES, 3))
    return waves / np.maximum(np.sqrt((waves**2).mean(axis=0)), 1e-12)
