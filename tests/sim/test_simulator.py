import gc
import resource

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from medor_cloth.camera import Camera
from medor_cloth.coverage import coverage
from medor_cloth.picker import SETTLE_FRAMES, pick_place
from medor_cloth.rollout import rollouts
from medor_sim.scene import Scene
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, Cancelled, EmergencyStopped, NotFound, OutOfReach, Refused
from medor_wire.messages import EmergencyStop, Empty, UploadGarment

LIFT = np.array([0.0, 0.0, 0.01])


def corner(bench) -> np.ndarray:
    """Picker centre over the vertex farthest along x + y."""
    positions = bench.positions()
    return positions[positions[:, :2].sum(axis=1).argmax()] + LIFT


@pytest.mark.parametrize("state", ["flat", "drop", pytest.param("picks", marks=pytest.mark.slow)])
def test_the_same_reset_gives_the_same_scene_to_the_bit(bench, state):
    bench.reset(state, seed=3)
    first = bench.positions()
    bench.act("disturb", corner(bench), [0.0, 0.0, 0.1])
    bench.reset(state, seed=3)
    assert np.array_equal(bench.positions(), first)
    if state != "flat":
        bench.reset(state, seed=4)
        assert not np.array_equal(bench.positions(), first)


def test_a_dropped_garment_is_crumpled_and_in_view(bench):
    score = bench.reset("drop", seed=1)
    assert score.coverage_m2 < 0.7 * score.flat_coverage_m2
    view = bench.simulator.capture(Empty(), Call())
    border = np.concatenate([view.mask[[0, -1]].ravel(), view.mask[:, [0, -1]].ravel()])
    assert view.mask.any()
    assert not border.any()
    assert (score.ni_flatten, score.ni_canonicalize, score.picks) == (0, 0, 0)


def test_a_flat_start_leaves_no_room_for_improvement(bench):
    score = bench.reset("flat")
    assert score.coverage_m2 == score.flat_coverage_m2
    assert score.canonical_cost_m < 0.001
    bench.act("fold", corner(bench), [0.0, 0.0, 0.05])
    assert bench.score().ni_flatten == 0
    assert bench.score().picks == 1


def test_improvement_is_measured_from_the_reset(bench):
    start = bench.reset("drop", seed=1)
    bench.act("any", corner(bench), corner(bench) + [0.06, 0.06, 0.02])
    now = bench.score()
    gained = (now.coverage_m2 - start.coverage_m2) / (start.flat_coverage_m2 - start.coverage_m2)
    assert now.ni_flatten == pytest.approx(gained)
    assert now.ni_canonicalize == pytest.approx(1 - now.canonical_cost_m / start.canonical_cost_m)


def test_capture_sees_the_cloth_where_it_truly_is(bench):
    bench.reset("drop", seed=1)
    view = bench.simulator.capture(Empty(), Call())
    mesh = bench.simulator.truth(Empty(), Call()).mesh
    camera = Camera(view.camera.K, view.camera.T_world_camera, view.camera.width, view.camera.height)
    seen = mesh.vertices[mesh.visible]
    uv, depth = camera.project(seen)
    row, column = uv[:, 1].astype(int), uv[:, 0].astype(int)
    inside = view.mask[row, column]
    assert binary_dilation(view.mask)[row, column].mean() > 0.99  # the outline's vertices fall on either side of it
    assert np.median(np.abs(view.depth[row, column] - depth)[inside]) < 0.001
    table_area = (view.depth.astype(float) ** 2).sum() / camera.K[0, 0] ** 2
    assert table_area == pytest.approx(coverage(mesh.vertices, mesh.faces), rel=0.06)  # seen in perspective


def test_truth_carries_the_garment_in_both_spaces(bench):
    bench.reset("flat")
    truth = bench.simulator.truth(Empty(), Call())
    assert truth.mesh.canonical is not None
    assert truth.mesh.panel_uv is not None
    assert np.ptp(truth.mesh.canonical[:, 2]) > 0.05
    assert 0.2 < truth.mesh.visible.mean() < 0.8  # a tube pressed flat hides its back


def test_an_action_is_the_pull_that_rollouts_predict(bench, wardrobe):
    scene = Scene.begin(wardrobe.generated("skirt", 800001), "flat", 0)
    pick = scene.cloth.positions[scene.cloth.positions[:, 0].argmax()] + LIFT
    place = pick + [-0.08, 0.02, 0.05]
    pulled = scene.pulled(pick, place, lambda: None)
    predicted = pick_place(scene.piece.solver, scene.cloth, pick, place, settle_frames=SETTLE_FRAMES)
    assert np.array_equal(pulled.scene.cloth.positions, predicted.state.positions)
    assert pulled.grasped is predicted.grasped is True


def test_an_action_is_the_pull_that_rollouts_predict_from_what_they_are_told(wardrobe):
    scene = Scene.begin(wardrobe.generated("skirt", 800001), "flat", 0)
    for axis in (0, 1):  # the second begins where the first has left the cloth
        told = scene.cloth.positions
        pick = (told[told[:, axis].argmax()] + LIFT).astype(np.float32)
        place = pick + np.array([-0.08, 0.02, 0.1], np.float32)
        pulled = scene.pulled(pick, place, lambda: None)
        (predicted,) = rollouts(scene.piece.solver, told, pick[None], place[None])
        assert np.array_equal(pulled.scene.cloth.positions, predicted)
        assert pulled.grasped
        scene = pulled.scene


def test_grasping_nothing_is_said_and_moves_nothing_far(bench):
    bench.reset("flat")
    before = bench.positions()
    outcome = bench.act("miss", [0.25, 0.25, 0.1], [0.0, 0.25, 0.1])
    assert not outcome.grasped
    assert np.abs(bench.positions() - before).max() < 0.005  # it settles a little more
    assert bench.act("hit", corner(bench), [0.0, 0.0, 0.1]).grasped


def test_out_of_reach_is_refused_before_anything_moves(bench):
    bench.reset("flat")
    before = bench.positions()
    with pytest.raises(OutOfReach, match="place"):
        bench.act("far", corner(bench), [1.0, 0.0, 0.1])
    with pytest.raises(OutOfReach, match="pick"):
        bench.act("low", [0.0, 0.0, -0.1], [0.0, 0.0, 0.1])
    assert np.array_equal(bench.positions(), before)
    assert bench.score().picks == 0


def test_an_emergency_stop_cuts_a_motion_short(bench):
    bench.reset("flat")
    start, place = corner(bench), np.array([-0.2, -0.2, 0.1])
    free = Scene.begin(bench.simulator._require_scene().piece, "flat", 0).pulled(start, place, lambda: None).scene

    def stop_when_moving(topic, message):
        if topic.name == "cell" and message.state == "moving":
            bench.lessor.stop(EmergencyStop(reason="hand in the cell"))

    bench.simulator._tell = stop_when_moving
    with pytest.raises(EmergencyStopped, match="hand in the cell"):
        bench.act("cut", start, place)
    assert np.abs(bench.positions() - free.cloth.positions).max() > 0.05
    with pytest.raises(EmergencyStopped):
        bench.act("next", start, place)


def test_an_asker_who_withdraws_stops_the_motion(bench):
    bench.reset("flat")
    call = Call()
    bench.simulator._tell = lambda topic, message: call.withdraw()
    with pytest.raises(Cancelled):
        bench.act("withdrawn", corner(bench), [0.0, 0.0, 0.1], call)


def test_observers_are_told_of_every_change(bench):
    bench.reset("flat")
    assert [name for name, _ in bench.told] == ["sensor/depth", "cell"]
    bench.told.clear()
    bench.act("seen", corner(bench), [0.0, 0.0, 0.1])
    assert [name for name, _ in bench.told] == ["cell", "sensor/depth", "cell", "action"]
    states = [message.state for name, message in bench.told if name == "cell"]
    assert states == ["moving", "idle"]


def test_an_empty_table_shows_nothing_and_can_do_nothing(bench):
    view = bench.simulator.capture(Empty(), Call())
    assert not view.depth.any()
    for verb in (bench.simulator.score, bench.simulator.truth):
        with pytest.raises(Refused, match="reset"):
            verb(Empty(), Call())
    with pytest.raises(Refused, match="reset"):
        bench.act("nothing", [0, 0, 0.02], [0, 0, 0.1])


def test_an_uploaded_garment_can_be_laid_out(bench, wardrobe):
    garment = wardrobe.generated("tshirt", 800001).garment
    upload = UploadGarment(content=as_obj(garment.vertices, garment.faces), file_type="obj", category="tshirt")
    reply = bench.simulator.upload_garment(upload, Call())
    assert (reply.vertices, reply.faces) == (len(garment.vertices), len(garment.faces))
    assert bench.simulator.upload_garment(upload, Call()) == reply
    score = bench.reset("flat", garment_id=reply.garment_id)
    assert bench.simulator.truth(Empty(), Call()).garment_id == reply.garment_id
    generated = bench.reset("flat", category="tshirt")
    assert score.flat_coverage_m2 == pytest.approx(generated.flat_coverage_m2, rel=0.2)


def test_bad_garments_are_refused_with_a_reason(bench):
    with pytest.raises(NotFound, match="never"):
        bench.reset("flat", garment_id="never")
    with pytest.raises(BadRequest, match="content"):
        bench.simulator.upload_garment(UploadGarment(content=b"no mesh", file_type="obj", category="skirt"), Call())


@pytest.mark.slow
def test_two_hundred_resets_leave_no_memory_behind(bench):
    def settled_kib(resets: range) -> int:
        for seed in resets:
            bench.reset("flat", category="tshirt", garment_seed=800000 + seed % 20)
            bench.simulator.capture(Empty(), Call())
            bench.told.clear()
        gc.collect()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    warm = settled_kib(range(40))
    assert settled_kib(range(200)) - warm < 60_000


def as_obj(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    return "\n".join(lines).encode()
