from types import SimpleNamespace

import numpy as np
import pytest

from medor_cloth.nocs import NOCS
from medor_cloth.raster import rasterize
from medor_recon.completed import Completed
from medor_recon.completion.turn import turns
from medor_recon.evaluate import oracle
from medor_recon.evaluate.__main__ import read
from medor_recon.evaluate.metrics import canonical_measures, mesh_measures
from medor_recon.evaluate.observed import Observed
from medor_recon.evaluate.report import BEFORE, markdown, summarize
from medor_recon.evaluate.sheet import HEADS, row, sheet
from medor_recon.evaluate.stages import Source, Stages
from medor_recon.methods import METHODS
from medor_wire.errors import ReconstructionFailed

from .crumpled import CAMERA, folded, garment, seen


class Trajectory(dict):
    """One step of the folded garment, as the data set would hold it."""

    id = 3

    @property
    def garment(self):
        return SimpleNamespace(category="tshirt", seed=800_010, garment=garment(), box=NOCS["tshirt"])


@pytest.fixture(scope="module")
def observed() -> Observed:
    raster, view = rasterize(folded(), garment().faces, CAMERA), seen()
    nocs = np.zeros((*raster.mask.shape, 3), np.float32)
    nocs[raster.mask] = view.nocs
    arrays = {"depth": raster.depth, "mask": raster.mask, "nocs": nocs, "positions": folded().astype(np.float32)}
    return Observed(Trajectory({name: array[None] for name, array in arrays.items()}), 0)  # type: ignore[arg-type]


@pytest.fixture
def source() -> Source:
    def canonicalize(observed, preset):
        return oracle.canonicalized(observed, 0.01, 0.01, np.random.default_rng(0))

    return Source(canonicalize, lambda observed, view, preset: oracle.completed(observed, view))


def measure(observed: Observed, shift: float = 0.0, turn: int = 0) -> dict[str, float]:
    """Of the true mesh, moved along x by a shift [m], when its sides are taken for each other."""
    shirt, turned = garment(), turns("tshirt")[turn]
    canonical = NOCS["tshirt"].decode(turned(NOCS["tshirt"].encode(shirt.vertices)))
    positions = observed.positions + np.array([shift, 0, 0], np.float32)
    return mesh_measures(Completed(canonical, shirt.faces, positions), positions, observed.truth, observed, turned)


def test_the_truth_is_without_error(observed):
    measures, _ = canonical_measures(observed.truth, observed)
    assert measures["canonical"] == pytest.approx(0, abs=1e-6)
    assert measures["side_right"] == 1
    found = measure(observed)
    for name in ("vertex", "visible", "hidden", "vertex_plain", "coverage"):
        assert found[name] == pytest.approx(0, abs=1e-4), name
    assert found["view_surface"] < 0.01
    assert found["chamfer"] < 0.3, "two samples of one surface are as far apart as its points"


def test_a_shifted_mesh_is_as_wrong_as_its_shift(observed):
    found = measure(observed, shift=0.01)
    for name in ("vertex", "visible", "hidden"):
        assert found[name] == pytest.approx(1.0, abs=1e-3)
    assert found["view"] > measure(observed)["view"]


def test_front_taken_for_back_is_an_error_of_the_side_alone(observed):
    view = seen()
    swapped = turns("tshirt")[1]
    view = type(view)(**{**view.__dict__, "nocs": swapped(view.nocs)})
    measures, turn = canonical_measures(view, observed)
    assert measures["canonical"] == pytest.approx(0, abs=1e-6)
    assert measures["canonical_plain"] > 0.1
    assert measures["side_right"] == 0
    assert np.array_equal(turn.matrix, swapped.matrix)
    found = measure(observed, turn=1)
    assert found["vertex"] == pytest.approx(0, abs=1e-3)
    assert found["vertex_plain"] > 1


def test_stretch_and_crossings_show_in_the_quality(observed):
    shirt = garment()
    stretched = shirt.vertices * np.array([1.5, 1.5, 1.5], np.float32)
    completed = Completed(shirt.vertices, shirt.faces, stretched)
    found = mesh_measures(completed, stretched, observed.truth, observed, turns("tshirt")[0])
    assert found["strain_5"] == pytest.approx(0.5, abs=1e-3)
    assert found["strain_95"] == pytest.approx(0.5, abs=1e-3)
    assert found["crossings"] == 0


def test_oracle_errors_are_as_large_as_asked(observed):
    rng = np.random.default_rng(1)
    for noise, bend in ((0.02, 0.0), (0.0, 0.03)):
        error = oracle.canonicalized(observed, noise, bend, rng).nocs - observed.truth.nocs
        assert np.sqrt((error**2).mean()) == pytest.approx(noise + bend, rel=0.1)


def test_methods_share_their_stages(observed, source):
    asked = []

    def complete(observed, view, preset):
        asked.append(preset)
        return source.complete(observed, view, preset)

    stages = Stages(observed, Source(source.canonicalize, complete))
    records = [stages.record(METHODS[name]) for name in ("medor", "held", "no-finetuning")]
    assert asked == ["cpu"]
    paper, held, none = records
    assert paper["before"] == held["before"]
    assert none["after"]["vertex"] == paper["before"]["vertex"]
    assert paper["after"]["view"] < 0.7 * paper["before"]["view"]
    assert held["after"]["hidden"] < 0.9 * held["before"]["hidden"]
    table = markdown(summarize(records))
    assert [line.split(" | ")[0].strip("| ") for line in table.splitlines()[4:7]] == ["medor" + BEFORE, "medor", "held"]


def test_a_failure_is_counted_not_averaged(observed, source):
    def refuse(observed, view, preset):
        raise ReconstructionFailed("a scrap")

    failed = Stages(observed, Source(source.canonicalize, refuse)).record(METHODS["medor"])
    assert failed["failed"] == "a scrap"
    good = Stages(observed, source).record(METHODS["medor"])
    summary = summarize([failed, good])["tshirt"]["medor"]
    assert (summary["count"], summary["failed"]) == (1, 1)
    assert summary["vertex"]["mean"] == good["after"]["vertex"]


def test_the_sheet_has_a_picture_under_every_heading(observed, source):
    pictures = row(Stages(observed, source), METHODS["medor"])
    assert len(pictures) == len(HEADS)
    assert np.abs(pictures[4].astype(int) - pictures[5]).mean() < np.abs(pictures[3].astype(int) - pictures[5]).mean()
    assert sheet([pictures, pictures]).shape[0] > 400


def test_a_line_cut_off_is_measured_again(tmp_path):
    log = tmp_path / "records.jsonl"
    log.write_text('{"observation": "a"}\n{"observation": "b"')
    assert list(read(log)) == [{"observation": "a"}]
