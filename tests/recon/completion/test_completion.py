from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_cloth.camera import overhead
from medor_cloth.nocs import NOCS
from medor_recon.completed import Completed
from medor_recon.completion.augment import Example
from medor_recon.completion.completion import check_completed
from medor_recon.completion.fill import FillConfig, PooledFill
from medor_recon.completion.measures import mesh_errors
from medor_recon.completion.pixels import thinned
from medor_recon.completion.template import Templates
from medor_recon.completion.template_completion import TemplateCompletion
from medor_recon.completion.turn import NONE
from medor_wire.errors import ReconstructionFailed

CAMERA = overhead(200)
PARTS = ("pixels", "points", "nocs", "confidence", "features")


@pytest.fixture(scope="module")
def completion(garments) -> TemplateCompletion:
    """Nothing learnt: the residual is silenced, the fill alone works."""
    torch.manual_seed(0)
    fill = PooledFill(FillConfig(), ("tshirt",))
    torch.nn.init.zeros_(fill.residual.layers[-1].weight)  # type: ignore[arg-type]
    torch.nn.init.zeros_(fill.residual.layers[-1].bias)  # type: ignore[arg-type]
    box = NOCS["tshirt"]
    templates = Templates.of(
        "tshirt", [g.seed for g in garments], [box.encode(g.vertices) for g in garments], [g.faces for g in garments]
    )
    return TemplateCompletion({"tshirt": templates}, fill)


def test_a_garment_laid_flat_is_completed_by_its_own_template(completion, seen, garment, laid):
    completed = completion.complete(seen)
    np.testing.assert_allclose(completed.canonical, garment.vertices, atol=2e-5)
    np.testing.assert_array_equal(completed.faces, garment.faces)
    errors = np.linalg.norm(completed.positions - laid, axis=1)
    assert errors.mean() < 0.02
    item = Example(thinned(seen, 0.01), NONE, NOCS["tshirt"].encode(garment.vertices), garment.faces, laid)
    measured = mesh_errors(completed, item, CAMERA, np.random.default_rng(0))
    assert measured["error_cm"] == pytest.approx(errors.mean() * 100, abs=0.01)
    assert measured["visible_cm"] < measured["error_cm"] < measured["hidden_cm"]
    assert measured["chamfer_cm"] < 0.4


def test_chamfer_is_that_of_a_shifted_sheet(garment, laid, seen):
    item = Example(thinned(seen, 0.01), NONE, NOCS["tshirt"].encode(garment.vertices), garment.faces, laid)
    far = Completed(garment.vertices + np.array([0, 0, 5], np.float32), garment.faces, laid)
    measured = mesh_errors(far, item, CAMERA, np.random.default_rng(0))
    assert measured["to_true_cm"] == pytest.approx(490, rel=0.05)
    assert measured["chamfer"] == pytest.approx(measured["chamfer_cm"] / 50.7)


def test_too_few_pixels_are_refused(completion, seen):
    few = replace(seen, **{part: getattr(seen, part)[:20] for part in PARTS})
    with pytest.raises(ReconstructionFailed, match="pixels on the cloth"):
        completion.complete(few)


def test_coordinates_that_are_no_numbers_are_refused(completion, seen):
    with pytest.raises(ReconstructionFailed, match="finite"):
        completion.complete(replace(seen, nocs=seen.nocs * np.float32(np.nan)))


def test_a_category_without_templates_is_refused(completion, seen):
    with pytest.raises(ReconstructionFailed, match="trousers"):
        completion.complete(replace(seen, category="trousers"))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda mesh: replace(mesh, faces=mesh.faces[:50]), "scrap of 50 faces"),
        (
            lambda mesh: replace(mesh, positions=mesh.positions + np.array([0.2, 0, 0], np.float32)),
            "away from what is seen",
        ),
        (lambda mesh: replace(mesh, positions=mesh.positions * np.float32(np.inf)), "finite"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_meshes_that_cannot_be_the_garment_are_refused(seen, garment, laid, change, reason):
    mesh = Completed(garment.vertices, garment.faces, laid)
    check_completed(mesh, seen)
    with pytest.raises(ReconstructionFailed, match=reason):
        check_completed(change(mesh), seen)
