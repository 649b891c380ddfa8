"""Reconstruction service: one depth image of a garment in, its cloth mesh out."""

import threading
from pathlib import Path

from medor_recon.networks import SHIPPED, Networks
from medor_recon.reconstructor import Reconstructor
from medor_recon.warm_up import warm_up
from medor_recon.whole import Trust
from medor_wire import endpoints
from medor_wire.bus import join
from medor_wire.config import Settings


class Config(Settings, section="recon"):
    min_height: float = 0.002
    """What rises higher above the table [m] is garment, when no mask comes with the view."""
    min_area: float = 0.002
    """Least visible area [m²] that counts as a garment."""
    weights: Path = SHIPPED
    """Folder of trained networks."""
    device: str = "cpu"
    """Where networks run, as torch names it."""
    threads: int = 1
    """Of the CPU, for networks. Views are small: on a busy machine more threads wait for each other."""
    min_confidence: float = Trust.min_confidence
    """Least mean confidence of the canonical coordinates at which a view counts as understood."""
    max_residual: float = Trust.max_residual_m
    """Largest mean distance of the points seen to the reconstructed mesh [m]."""


def main(config: Config) -> None:
    trust = Trust(min_confidence=config.min_confidence, max_residual_m=config.max_residual)
    networks = Networks(config.weights, config.device, config.threads)
    reconstructor = Reconstructor(config.min_height, config.min_area, networks, trust)
    with join("recon", config.bus) as wire:
        wire.serve(endpoints.RECONSTRUCT, reconstructor.reconstruct)
        threading.Thread(target=warm_up, args=(reconstructor,), name="warm-up", daemon=True).start()
        wire.run()


if __name__ == "__main__":
    main(Config.from_command_line())
