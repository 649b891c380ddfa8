"""Reconstruction service: one depth image of a garment in, its cloth mesh out."""

from medor_recon.reconstructor import Reconstructor
from medor_wire import endpoints
from medor_wire.bus import join
from medor_wire.config import Settings


class Config(Settings, section="recon"):
    min_height: float = 0.002
    """What rises higher above the table [m] is garment, when no mask comes with the view."""
    min_area: float = 0.002
    """Least visible area [m²] that counts as a garment."""


def main(config: Config) -> None:
    reconstructor = Reconstructor(config.min_height, config.min_area)
    with join("recon", config.bus) as wire:
        wire.serve(endpoints.RECONSTRUCT, reconstructor.reconstruct)
        wire.run()


if __name__ == "__main__":
    main(Config.from_command_line())
