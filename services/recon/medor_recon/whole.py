"""The whole garment from a view: canonicalise, complete, finetune (MEDOR, section IV), and refuse what looks wrong."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from medor_cloth.camera import Camera
from medor_cloth.cloth import Cloth
from medor_cloth.errors import ClothError
from medor_cloth.nocs import NOCS
from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.methods import Method
from medor_recon.networks import Networks
from medor_recon.refine import Refined, refine
from medor_recon.stopwatch import Stopwatch
from medor_wire.errors import ReconstructionFailed
from medor_wire.messages import Category, ClothMesh


@dataclass(frozen=True)
class Trust:
    """What a reconstruction must be like to be handed out."""

    min_pixels: int = 300
    """Cloth pixels of the network's image, 2.7 mm wide each on the table."""
    min_confidence: float = 0.08
    """Mean probability of the chosen bins; one of 64 alike would have 0.016, garments have 0.11 and more."""
    max_residual_m: float = 0.01
    """Mean distance of the observed points to the visible vertices after finetuning; garments have 8 mm and less."""

    def check_seen(self, seen: Canonicalized) -> None:
        """Raises `ReconstructionFailed`."""
        if len(seen.pixels) < self.min_pixels:
            raise ReconstructionFailed(f"expected at least {self.min_pixels} cloth pixels, got {len(seen.pixels)}")
        confidence = float(seen.confidence.mean())
        if confidence < self.min_confidence:
            raise ReconstructionFailed(
                f"the view is not understood: mean confidence {confidence:.3f}, expected {self.min_confidence} or more"
            )

    def check_mesh(self, completed: Completed, refined: Refined | None) -> None:
        """Raises `ReconstructionFailed`. A mesh that was not finetuned need not explain the view."""
        if refined and not refined.residual_m <= self.max_residual_m:
            raise ReconstructionFailed(
                f"the mesh does not explain the view: the points seen lie {refined.residual_m * 1e3:.0f} mm from it on "
                f"average, expected {self.max_residual_m * 1e3:.0f} mm or less"
            )
        try:
            Cloth.from_mesh(completed.canonical, completed.faces)
        except ClothError as error:
            raise ReconstructionFailed(f"the completed shape cannot be cloth: {error}") from error


def reconstruct(
    method: Method,
    category: Category,
    depth: NDArray[np.float32],
    camera: Camera,
    networks: Networks,
    trust: Trust,
    stopwatch: Stopwatch,
) -> ClothMesh:
    """The mesh of a garment, hidden parts included.

    Args:
        method: which networks and which finetuning.
        category: of the garment.
        depth: (H, W) [m], 0 off the garment.
        camera: which took it.
        networks: trained ones.
        trust: what is refused.
        stopwatch: told the stages.

    Raises:
        BadRequest: no weights for this method and category.
        NoGarment: nothing is seen where the overhead camera looks.
        ReconstructionFailed: too little seen, not understood, or a mesh that is degenerate or does not fit the view.
    """
    with stopwatch.stage("load"):
        canonicalizer = networks.canonicalizer(method.canonical, category)
        completion = networks.completion(method.completion, category)
    with stopwatch.stage("canonicalize"):
        seen = canonicalizer.canonicalize(category, depth, camera)
        trust.check_seen(seen)
    with stopwatch.stage("complete"):
        completed = completion.complete(seen)
    with stopwatch.stage("refine"):
        refined = refine(completed, seen, method.refine)
        trust.check_mesh(completed, refined if method.refine else None)
    return ClothMesh(
        vertices=refined.positions,
        faces=np.ascontiguousarray(completed.faces, np.int32),
        category=category,
        visible=refined.visible,
        canonical=completed.canonical.astype(np.float32),
        confidence=confidence(completed, seen),
    )


def confidence(completed: Completed, seen: Canonicalized) -> NDArray[np.float32]:
    """(V,) the network's mean probability at the pixel that each vertex is nearest to in canonical space."""
    _, pixel = KDTree(seen.nocs).query(NOCS[seen.category].encode(completed.canonical))
    return seen.confidence.mean(axis=1)[pixel].astype(np.float32)
