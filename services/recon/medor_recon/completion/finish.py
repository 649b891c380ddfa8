"""What is chosen and measured once a network has learnt: templates, thresholds, and the errors of whole meshes."""

from collections.abc import Iterable

import numpy as np
import torch

from medor_cloth.nocs import NOCS
from medor_recon.canonicalized import Canonicalized
from medor_recon.completion.augment import Example, example
from medor_recon.completion.completion import Completion
from medor_recon.completion.field import Field
from medor_recon.completion.field_completion import DEFAULT_THRESHOLD, winding_grid
from medor_recon.completion.material import Material
from medor_recon.completion.measures import mean_of, mesh_errors
from medor_recon.completion.observations import CAMERA, Observation, truth
from medor_recon.completion.opening import best_threshold, closed_surface, on_cloth
from medor_recon.completion.queries import on_surface
from medor_recon.completion.template import Templates, medoids
from medor_wire.errors import ReconstructionFailed

ON_CLOTH_M = 0.01
"""Distance from the true garment within which a vertex of the closed surface is cloth."""
CLOTH_SAMPLES = 10_000


def choose_templates(learn: list[Observation], category: str, number: int) -> Templates:
    """Medoids of the garments that are learnt from."""
    shapes = {id(one.shape): one.shape for one in learn if one.shape.record.category == category}
    chosen = list(shapes.values())
    chosen = [chosen[k] for k in medoids([shape.nocs for shape in chosen], number)]
    seeds = [shape.record.seed for shape in chosen]
    return Templates.of(category, seeds, [shape.nocs for shape in chosen], [shape.faces for shape in chosen])


def choose_threshold(field: Field, examples: list[Example], rng: np.random.Generator) -> float:
    """The gradient of the field that tells cloth from openings best, over some views of one category.

    Views whose field has no surface say nothing; without any other the published threshold stays.
    """
    steepness, true = [], []
    for item in examples:
        with torch.inference_mode():
            winding = winding_grid(field, field.volume([field.frame(item.pixels).view(item.pixels)]))
        try:
            vertices, _, steep = closed_surface(winding)
        except ReconstructionFailed:
            continue
        cloth, _ = on_surface(item, rng, CLOTH_SAMPLES, push=0.0)
        true.append(on_cloth(vertices, cloth, ON_CLOTH_M / NOCS[item.pixels.category].side))
        steepness.append(steep)
    if not steepness:
        return DEFAULT_THRESHOLD
    return best_threshold(np.concatenate(steepness), np.concatenate(true))


def measure(
    completion: Completion, material: Material, looked_at: Iterable[Observation]
) -> dict[str, dict[str, float]]:
    """Errors of whole meshes of some observations, from `true` canonical coordinates and from `predicted` ones.

    `failed` is the share of views that were refused; the other measures are of the rest.
    """
    looked_at = list(looked_at)
    views = {"true": [(truth(one.trajectory, one.step), example(one)) for one in looked_at]}
    if material.predictions:
        views["predicted"] = [
            (material.predictions.seen(one), example(one, material.predictions(one))) for one in looked_at
        ]
    if material.only_predicted:
        views.pop("true")
    return {name: _mean(completion, pairs) for name, pairs in views.items()}


def _mean(completion: Completion, pairs: list[tuple[Canonicalized, Example]]) -> dict[str, float]:
    rng = np.random.default_rng(0)
    rows: list[dict[str, float]] = []
    refused = 0
    for seen, item in pairs:
        try:
            rows.append(mesh_errors(completion.complete(seen), item, CAMERA, rng))
        except ReconstructionFailed:
            refused += 1
    return mean_of(rows) | {"failed": refused / max(len(pairs), 1)}
