"""Trained networks by preset and category: the shipped ones, or those of another folder.

torch takes seconds to import and is not needed to see what is visible: it is imported with the first network.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from medor_wire.errors import BadRequest

if TYPE_CHECKING:
    from medor_recon.canonical.canonicalizer import Canonicalizer
    from medor_recon.completion.completion import Completion

SHIPPED = Path(__file__).parent / "weights"
"""Weights that come with the package."""


class Networks:
    """Loads networks when they are first asked for, and keeps them.

    Args:
        root: holds one folder a network, named `<part>-<preset>-<category>`, or `<part>-<preset>` for all categories.
        device: where to run them.
        threads: of the CPU, for all of torch in this process once a network is loaded; None leaves that as it is.
    """

    def __init__(self, root: Path = SHIPPED, device: str = "cpu", threads: int | None = None) -> None:
        self.root, self.device, self.threads = root, device, threads
        self._canonicalizer = cache(self._load_canonicalizer)
        self._completion = cache(self._load_completion)

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

    def _load_canonicalizer(self, folder: Path) -> Canonicalizer:
        import torch

        from medor_recon.canonical.canonicalizer import Canonicalizer

        if self.threads is not None:
            torch.set_num_threads(self.threads)
        return Canonicalizer.load(folder, self.device)

    def _load_completion(self, folder: Path) -> Completion:
        from medor_recon.completion import weights

        return weights.load(folder, self.device)
