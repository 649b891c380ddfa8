"""Completion by fields: winding numbers on a grid, their surface, and where it lies (MEDOR, section III-B)."""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from medor_cloth.cluster import cluster
from medor_cloth.nocs import NOCS
from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.completion.completion import check_completed, check_pixels
from medor_recon.completion.field import Field
from medor_recon.completion.opening import closed_surface, compact, opened
from medor_recon.completion.pixels import thinned
from medor_recon.completion.scatter import nodes_of

VOXEL_M = 0.005
"""Vertices of the level surface that share a voxel of this size become one."""
MIN_HEIGHT_M = 1e-5
"""Faces flatter than this, left over by the clustering, are lines: cloth cannot be made of them."""
CHUNK = 65_536
"""Points decoded at a time."""
DEFAULT_THRESHOLD = 0.1
"""Gradient per node distance that is cloth, where none was chosen on validation (MEDOR's for 128 nodes)."""


class FieldCompletion:
    """A trained field as a `Completion`.

    Args:
        field: the network.
        thresholds: of the field's gradient, by category, chosen on validation for `field.config.nodes` nodes.
        spacing: of the pixels it is fed [m].
    """

    def __init__(self, field: Field, thresholds: Mapping[str, float], spacing: float) -> None:
        self.field, self.thresholds, self.spacing = field.eval(), thresholds, spacing

    def complete(self, seen: Canonicalized) -> Completed:
        """See `Completion`."""
        pixels = thinned(seen, self.spacing)
        check_pixels(pixels)
        with torch.inference_mode():
            volume = self.field.volume([self.field.frame(pixels).view(pixels)])
            vertices, faces, steepness = closed_surface(winding_grid(self.field, volume))
        nocs, faces = opened(vertices, faces, steepness, self.thresholds.get(seen.category, DEFAULT_THRESHOLD))
        canonical = NOCS[seen.category].decode(nocs)
        reduced = cluster(canonical, faces, VOXEL_M)
        canonical = canonical[reduced.ids]
        canonical, faces = compact(canonical, reduced.faces[_heights(canonical[reduced.faces]) > MIN_HEIGHT_M])
        completed = Completed(canonical, faces, self.field.warp_in(volume, pixels, canonical))
        check_completed(completed, seen)
        return completed


def winding_grid(field: Field, volume: Tensor) -> NDArray[np.float32]:
    """Winding numbers (N, N, N) at the nodes of the NOCS cube, indexed [x, y, z], of a volume (1, C, G, G, G)."""
    nodes = field.config.nodes
    with torch.inference_mode():
        chunks = nodes_of(nodes).to(volume.device).split(CHUNK)
        winding = torch.cat([field.winding(volume, chunk[None])[0] for chunk in chunks])
    return winding.view(nodes, nodes, nodes).cpu().numpy()


def _heights(corners: NDArray[np.floating]) -> NDArray[np.floating]:
    """(F,) the smallest height of each triangle (F, 3, 3)."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return area / np.maximum(sides.max(axis=1), 1e-12)
