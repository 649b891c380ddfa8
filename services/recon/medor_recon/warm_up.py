"""Load and compile what a reconstruction needs before the first one is asked for."""

import logging

import numpy as np

from medor_cloth.camera import overhead
from medor_recon.reconstructor import Reconstructor
from medor_wire.errors import MedorError
from medor_wire.messages import CameraInfo, DepthView, ReconstructRequest

log = logging.getLogger(__name__)

PATCH_M = 0.2
HEIGHT_M = 0.01


def warm_up(reconstructor: Reconstructor) -> None:
    """Reconstructs a square patch: torch is imported, networks of one category are loaded, loops are compiled."""
    request = ReconstructRequest(view=patch(), category="tshirt")
    try:
        reconstructor.reconstruct(request)
    except MedorError as error:  # without weights, or a patch that is no shirt: whoever asks is told
        log.info("warmed up as far as it goes: %s", error)


def patch(pixels: int = 240) -> DepthView:
    """A square of cloth at rest on the table, seen by the overhead camera."""
    camera = overhead(pixels)
    height, focal = float(camera.T_world_camera[2, 3]), float(camera.K[0, 0])
    half = PATCH_M / 2 * focal / (height - HEIGHT_M)
    away = np.abs(np.arange(pixels) + 0.5 - pixels / 2)
    mask = (away[:, None] < half) & (away < half)
    depth = np.where(mask, height - HEIGHT_M, height).astype(np.float32)
    info = CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=pixels, height=pixels)
    return DepthView(depth=depth, camera=info, mask=mask)
