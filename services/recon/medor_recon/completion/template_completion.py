"""Completion by a template garment whose every vertex is placed by its visible neighbours and a small network."""

from collections.abc import Mapping

from medor_recon.canonicalized import Canonicalized
from medor_recon.completed import Completed
from medor_recon.completion.completion import check_completed, check_pixels
from medor_recon.completion.fill import PooledFill
from medor_recon.completion.pixels import thinned
from medor_recon.completion.template import Templates
from medor_wire.errors import ReconstructionFailed


class TemplateCompletion:
    """Templates and a trained fill as a `Completion`.

    Args:
        templates: by category.
        fill: places their vertices.
    """

    def __init__(self, templates: Mapping[str, Templates], fill: PooledFill) -> None:
        self.templates, self.fill = templates, fill.eval()

    def complete(self, seen: Canonicalized) -> Completed:
        """See `Completion`."""
        templates = self.templates.get(seen.category)
        if templates is None:
            known = ", ".join(sorted(self.templates))
            raise ReconstructionFailed(f"no templates of category {seen.category!r}, only of {known}")
        pixels = thinned(seen, self.fill.config.spacing)
        check_pixels(pixels)
        chosen = templates.nearest(pixels)
        canonical = templates.canonical(chosen)
        completed = Completed(canonical, templates[chosen][1], self.fill.positions(pixels, canonical))
        check_completed(completed, seen)
        return completed
