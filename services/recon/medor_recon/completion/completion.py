"""One interface for every way of completing a view, and what each of them refuses."""

from typing import Protocol

import numpy as np
from scipy.spatial import KDTree

from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.completion.pixels import Pixels
from medor_wire.errors import ReconstructionFailed

MIN_PIXELS = 30
"""Fewer pixels on the cloth than this, thinned as the network wants them, say nothing about the rest."""
MIN_FACES = 200
"""A surface of fewer faces is a scrap."""
MAX_DISTANCE_M = 0.05
"""Mean distance from the visible points to a mesh beyond which the mesh does not show what is seen."""


class Completion(Protocol):
    """One way of completing a view."""

    def complete(self, seen: Canonicalized) -> Completed:
        """The whole garment, in canonical space and on the table.

        Raises:
            ReconstructionFailed: too little is seen, or what came out is not the garment in view.
        """
        ...


def check_pixels(pixels: Pixels) -> None:
    """Refuse views that cannot be completed.

    Raises:
        ReconstructionFailed: too few pixels on the cloth, or values that are not numbers.
    """
    if len(pixels.points) < MIN_PIXELS:
        raise ReconstructionFailed(f"expected at least {MIN_PIXELS} pixels on the cloth, got {len(pixels.points)}")
    if not (np.isfinite(pixels.points).all() and np.isfinite(pixels.nocs).all()):
        raise ReconstructionFailed("expected finite points and canonical coordinates, got some that are not")


def check_completed(completed: Completed, seen: Canonicalized) -> None:
    """Refuse a mesh that cannot be the garment in view.

    Raises:
        ReconstructionFailed: a scrap, values that are not numbers, or a mesh away from the visible points.
    """
    if len(completed.faces) < MIN_FACES:
        raise ReconstructionFailed(f"expected a garment, got a scrap of {len(completed.faces)} faces")
    if not np.isfinite(completed.positions).all():
        raise ReconstructionFailed("expected finite positions, got some that are not")
    distance, _ = KDTree(completed.positions).query(seen.points[:: max(1, len(seen.points) // 500)])
    if distance.mean() > MAX_DISTANCE_M:
        raise ReconstructionFailed(f"the mesh lies {distance.mean() * 100:.1f} cm away from what is seen, on average")
