"""Variations of an observation: other places on the table, mirrored garments, and errors of a canonicaliser."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medor_recon.completion.observations import Observation, Prediction
from medor_recon.completion.pixels import Pixels
from medor_recon.completion.turn import MIRRORED, NONE, Turn, turns


@dataclass(frozen=True)
class Augmentation:
    """How far observations are varied.

    Attributes:
        predicted: share of views taken from a canonicaliser instead of the truth, if there are such.
        spread: of the independent errors of true coordinates in the NOCS cube; one of these is drawn for a view.
        bend: spread of the smooth error of true coordinates.
        outliers: largest share of true coordinates exchanged for those of other pixels.
        turned: share of true views taken for a turned garment.
        mirrored: share of views mirrored, cloth and table alike.
        offset: spread of the garment's place on the table [m].
        noise: spread of the measured points [m].
    """

    predicted: float = 0.5
    spread: tuple[float, ...] = (0.0, 0.02, 0.05)
    bend: float = 0.02
    outliers: float = 0.2
    turned: float = 0.25
    mirrored: float = 0.5
    offset: float = 0.02
    noise: float = 0.001


@dataclass(frozen=True, eq=False)
class Example:
    """A view and what is to be learnt from it.

    Attributes:
        pixels: what the network is fed.
        turn: from the garment's shape to the shape the view is taken for.
        nocs: (V, 3) float32 vertices of that shape.
        faces: (F, 3) int32, wound outwards.
        positions: (V, 3) float32 where they are, world frame [m].
    """

    pixels: Pixels
    turn: Turn
    nocs: NDArray[np.float32]
    faces: NDArray[np.int32]
    positions: NDArray[np.float32]


def example(observation: Observation, prediction: Prediction | None = None) -> Example:
    """An observation as it is, seen by a canonicaliser or else with its true coordinates."""
    pixels, turn = (prediction.pixels, prediction.turn) if prediction else (observation.true, NONE)
    shape = observation.shape
    return Example(pixels, turn, turn(shape.nocs), turn.wind(shape.faces), observation.positions)


def varied(
    observation: Observation, prediction: Prediction | None, augmentation: Augmentation, rng: np.random.Generator
) -> Example:
    """An observation somewhere else on the table, perhaps mirrored, with errors in its coordinates."""
    plain = example(observation, prediction)
    if prediction is None:
        plain = _mistaken(plain, augmentation, rng)
    if rng.random() < augmentation.mirrored:
        plain = _mirrored(plain)
    return _moved(plain, augmentation, rng)


def _mistaken(plain: Example, augmentation: Augmentation, rng: np.random.Generator) -> Example:
    """True coordinates with a canonicaliser's kinds of error, confidence falling as errors grow."""
    others = turns(plain.pixels.category)[1:]
    turn = others[rng.integers(len(others))] if rng.random() < augmentation.turned else NONE
    nocs = turn(plain.pixels.nocs)
    spread = rng.choice(augmentation.spread)
    wrong = nocs + rng.normal(0, spread, nocs.shape) + _bend(nocs, augmentation.bend, rng)
    stray = rng.random(len(nocs)) < rng.uniform(0, augmentation.outliers)
    wrong[stray] = nocs[rng.integers(len(nocs), size=int(stray.sum()))]
    missed = np.linalg.norm(wrong - nocs, axis=1, keepdims=True)
    sure = 1 / (1 + missed / 0.05) * rng.uniform(0.6, 1, nocs.shape)
    pixels = Pixels(
        plain.pixels.category,
        plain.pixels.points,
        wrong.clip(0, 1).astype(np.float32),
        sure.astype(np.float32),
        plain.pixels.features,
    )
    return Example(pixels, turn, turn(plain.nocs), turn.wind(plain.faces), plain.positions)


def _bend(nocs: NDArray[np.float32], size: float, rng: np.random.Generator) -> NDArray[np.floating]:
    """A smooth error (P, 3): an offset and a wave along a random direction."""
    wave = rng.normal(0, size, (1, 3)) * np.sin(nocs @ rng.normal(0, 5, (3, 1)) + rng.uniform(0, 2 * np.pi))
    return rng.normal(0, size / 2, (1, 3)) + wave


def _mirrored(plain: Example) -> Example:
    """The mirrored garment, crumpled the mirrored way."""
    world = np.array([-1, 1, 1], np.float32)
    old = plain.pixels
    pixels = Pixels(old.category, old.points * world, MIRRORED(old.nocs), old.confidence, old.features)
    return Example(
        pixels, plain.turn.then(MIRRORED), MIRRORED(plain.nocs), MIRRORED.wind(plain.faces), plain.positions * world
    )


def _moved(plain: Example, augmentation: Augmentation, rng: np.random.Generator) -> Example:
    """Turned about the vertical by any angle and pushed a little."""
    angle = rng.uniform(-np.pi, np.pi)
    cosine, sine = np.cos(angle), np.sin(angle)
    R = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    t = np.append(rng.normal(0, augmentation.offset, 2), 0)
    old = plain.pixels
    points = old.points @ R.T + t + rng.normal(0, augmentation.noise, old.points.shape)
    pixels = Pixels(old.category, points.astype(np.float32), old.nocs, old.confidence, old.features)
    return Example(pixels, plain.turn, plain.nocs, plain.faces, (plain.positions @ R.T + t).astype(np.float32))
