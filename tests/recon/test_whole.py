from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from medor_cloth.camera import overhead
from medor_cloth.raster import rasterize, visible_vertices
from medor_recon.networks import Networks
from medor_recon.reconstructor import Reconstructor
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, Cancelled, ReconstructionFailed
from medor_wire.messages import CameraInfo, DepthView, ReconstructProgress, ReconstructRequest

from .crumpled import filled, folded, garment, seen

STAGES = ["segment", "points", "load", "canonicalize", "complete", "refine"]


@dataclass
class Knowing:
    """Networks that have learnt the folded garment by heart, up to what is changed of their answers."""

    seen: dict = field(default_factory=dict)
    completed: dict = field(default_factory=dict)
    shown: np.ndarray = field(default_factory=lambda: np.empty(0))

    def canonicalizer(self, preset: str, category: str) -> "Knowing":
        return self

    completion = canonicalizer

    def canonicalize(self, category, depth, camera):
        self.shown = depth
        return replace(seen(0.01, np.random.default_rng(0)), **self.seen)

    def complete(self, view):
        return replace(filled(view), **self.completed)


def view(speck: bool = False) -> DepthView:
    camera = overhead(360)
    raster = rasterize(folded(), garment().faces, camera)
    depth, mask = raster.depth.copy(), raster.mask.copy()
    if speck:
        depth[20:28, 20:28], mask[20:28, 20:28] = 0.64, True
    info = CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=360, height=360)
    return DepthView(depth=depth, camera=info, mask=mask)


def ask(networks, method: str = "medor", call: Call | None = None, **options):
    request = ReconstructRequest(view=view(**options), category="tshirt", method=method)
    return Reconstructor(networks=networks).reconstruct(request, call)


def test_the_whole_garment_comes_back_in_both_spaces():
    mesh = ask(Knowing()).mesh
    assert mesh.canonical is not None
    assert mesh.confidence is not None
    assert mesh.canonical == pytest.approx(garment().vertices)
    assert 0.2 < mesh.visible.mean() < 0.8, "some of it is hidden"
    seen_in_truth = visible_vertices(folded(), garment().faces, overhead())
    assert np.linalg.norm(mesh.vertices - folded(), axis=1)[seen_in_truth].mean() < 0.02
    assert mesh.confidence.min() >= 0
    assert mesh.confidence.max() <= 1


def test_finetuning_is_what_the_ablation_leaves_out():
    with_it, without = ask(Knowing(), "medor"), ask(Knowing(), "no-finetuning")
    assert np.array_equal(without.mesh.vertices, filled(Knowing().canonicalize("tshirt", None, None)).positions)
    assert not np.array_equal(with_it.mesh.vertices, without.mesh.vertices)


def test_vertices_are_as_sure_as_the_pixels_of_their_part():
    truth = seen()
    left = truth.nocs[:, 0] < 0.5
    sure = np.where(left[:, None], 0.9, 0.1).astype(np.float32) * np.ones((1, 3), np.float32)
    mesh = ask(Knowing(seen={"nocs": truth.nocs, "confidence": sure})).mesh
    assert mesh.confidence is not None
    side = garment().vertices[:, 0]
    assert mesh.confidence[side < -0.05].mean() > 0.8
    assert mesh.confidence[side > 0.05].mean() < 0.2


def test_every_stage_is_told_and_timed():
    told = []
    reply = ask(Knowing(), call=Call(progress=told.append))
    assert told == [ReconstructProgress(stage=stage) for stage in STAGES]
    assert list(reply.timings_ms) == [*STAGES, "total"]
    assert sum(reply.timings_ms[stage] for stage in STAGES) <= reply.timings_ms["total"]


def test_a_withdrawn_request_is_not_carried_on():
    call = Call()
    call.withdraw()
    with pytest.raises(Cancelled):
        ask(Knowing(), call=call)


def test_a_speck_beside_the_garment_is_not_shown_to_the_networks():
    networks = Knowing()
    ask(networks, speck=True)
    assert np.array_equal(networks.shown, view().depth)


@pytest.mark.parametrize(
    ("networks", "reason"),
    [
        (
            lambda: Knowing(seen={name: getattr(seen(), name)[:100] for name in ("pixels", "points", "nocs")}),
            "300 cloth",
        ),
        (lambda: Knowing(seen={"confidence": np.full_like(seen().nocs, 0.02)}), "not understood.* 0.020"),
        (lambda: Knowing(completed={"positions": folded().astype(np.float32) + np.float32(0.15)}), "not explain"),
        (lambda: Knowing(completed={"canonical": np.zeros_like(garment().vertices)}), "cannot be cloth"),
        (lambda: Knowing(completed={"positions": np.full_like(garment().vertices, np.nan)}), "finite"),
    ],
    ids=["few pixels", "unsure", "misfit", "degenerate", "not finite"],
)
def test_rubbish_is_refused_with_its_reason(networks, reason):
    with pytest.raises(ReconstructionFailed, match=reason):
        ask(networks())


def test_missing_weights_name_the_command_that_trains_them(tmp_path):
    with pytest.raises(BadRequest, match=r"medor_recon\.train canonical --preset cpu --categories tshirt"):
        ask(Networks(tmp_path))


def test_weights_of_one_category_come_before_those_of_all(tmp_path):
    networks = Networks(tmp_path)
    for name in ("canonical-cpu", "canonical-cpu-skirt"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "config.json").write_text("{}")
    assert networks.folder("canonical", "cpu", "skirt").name == "canonical-cpu-skirt"
    assert networks.folder("canonical", "cpu", "dress").name == "canonical-cpu"
