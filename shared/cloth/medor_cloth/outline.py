"""Plane curves from which garment panels are drawn: polylines (n, 2) in metres, x lateral, y up."""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

Curve = NDArray[np.float64]


def length(curve: Curve) -> float:
    """Arc length [m]."""
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


def resample(curve: Curve, segments: int) -> Curve:
    """The same curve with `segments` equally long pieces, (segments + 1, 2); both ends are kept."""
    arc = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))]
    at = np.linspace(0.0, arc[-1], segments + 1)
    return np.column_stack([np.interp(at, arc, curve[:, 0]), np.interp(at, arc, curve[:, 1])])


def line(*points: ArrayLike) -> Curve:
    """The polyline through the given points."""
    return np.array(points, dtype=np.float64)


def bezier(*controls: ArrayLike, samples: int = 24) -> Curve:
    """The Bézier curve of any degree with the given control points (de Casteljau)."""
    t = np.linspace(0.0, 1.0, samples)[:, None]
    layers = [np.broadcast_to(np.asarray(c, np.float64), (samples, 2)) for c in controls]
    while len(layers) > 1:
        layers = [(1 - t) * a + t * b for a, b in pairwise(layers)]
    return layers[0]


def join(first: Curve, *others: Curve) -> Curve:
    """Curves end to start; the shared points appear once."""
    return np.vstack([first, *(other[1:] for other in others)])


def mirror(curve: Curve) -> Curve:
    """The curve on the other side of the body (x → −x), walked backwards so that outlines stay closed."""
    return curve[::-1] * (-1.0, 1.0)


def fillet(start: ArrayLike, corner: ArrayLike, end: ArrayLike, radius: float) -> Curve:
    """The path start → corner → end with the corner rounded over at most `radius` on each side."""
    a, b, c = (np.asarray(p, np.float64) for p in (start, corner, end))
    before, after = float(np.linalg.norm(a - b)), float(np.linalg.norm(c - b))
    radius = min(radius, 0.45 * before, 0.45 * after)
    enter, leave = b + radius * (a - b) / before, b + radius * (c - b) / after
    return join(line(a, enter), bezier(enter, b, leave, samples=12), line(leave, c))


def arc(radius: float, angle: float, centre_y: float, samples: int = 40) -> Curve:
    """The arc below (0, centre_y), from left to right, opening `angle` [rad] symmetrically about the y axis."""
    t = np.linspace(-angle / 2, angle / 2, samples)
    return np.column_stack([radius * np.sin(t), centre_y - radius * np.cos(t)])
