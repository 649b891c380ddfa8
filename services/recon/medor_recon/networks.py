"""Trained networks by preset and category: the shipped ones, or those of another folder."""

from functools import lru_cache
from pathlib import Path

from medor_recon.canonical.canonicalizer import Canonicalizer
from medor_recon.completion import weights as completions
from medor_recon.completion.completion import Completion
from medor_wire.errors import BadRequest

SHIPPED = Path(__file__).parent / "weights"
"""Weights that come with the package."""


class Networks:
    """Loads networks when they are first asked for, and keeps them.

    Args:
        root: holds one folder a network, named `<part>-<preset>-<category>`, or `<part>-<preset>` for all categories.
        device: where to run them.
    """

    def __init__(self, root: Path = SHIPPED, device: str = "cpu") -> None:
        self.root, self.device = root, device
        self._canonicalizer = lru_cache(lambda folder: Canonicalizer.load(folder, device))
        self._completion = lru_cache(lambda folder: completions.load(folder, device))

    def canonicalizer(self, preset: str, category: str) -> Canonicalizer:
        """Raises `BadRequest` where there are no weights."""
        return self._canonicalizer(self.folder("canonical", preset, category))

    def completion(self, preset: str, category: str) -> Completion:
        """Raises `BadRequest` where there are no weights."""
        return self._completion(self.folder("completion", preset, category))

    def folder(self, part: str, preset: str, category: str) -> Path:
        """Where the weights are.

        Raises:
            BadRequest: nowhere.
        """
        names = (f"{part}-{preset}-{category}", f"{part}-{preset}")
        for name in names:
            if (self.root / name / "config.json").is_file():
                return self.root / name
        raise BadRequest(
            f"no weights {' or '.join(names)} in {self.root.name}/; they are trained by `python -m medor_recon.train "
            f"{part} --preset {preset} --categories {category} --data <folder> --out <folder>`"
        )
