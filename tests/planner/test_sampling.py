import numpy as np
import pytest
from scipy.spatial import KDTree

from medor_cloth.grasp import REACH_M
from medor_planner.random_policy import CLEARANCE_M, random_action
from medor_planner.sampling import LENGTHS_M, PICKER_ABOVE_M, Scene, anywhere, pulls, sample
from medor_wire.errors import NoGarment, OutOfReach, ReconstructionFailed


@pytest.fixture
def scene(sheet_scene) -> Scene:
    """A sheet of 20 x 24 cm whose right third is folded over, so that much of it is hidden."""
    return sheet_scene(folded=True)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def every_pull(picks, places):
    return anywhere(picks)


def test_every_pick_is_a_visible_vertex_one_centimetre_up(scene):
    candidates = sample(scene, 400, rng(), reachable=every_pull)
    assert len(candidates) == 400
    assert 0 < scene.mesh.visible.sum() < len(scene.visible) + 20
    assert not scene.mesh.visible.all()
    visible = {tuple(v) for v in scene.visible + np.array([0, 0, PICKER_ABOVE_M], np.float32)}
    assert {tuple(pick) for pick in candidates.picks} <= visible


def test_every_place_is_in_view_level_or_higher_and_5_to_20_cm_away(scene):
    candidates = sample(scene, 2000, rng(), reachable=every_pull)
    way = candidates.places - candidates.picks
    length = np.linalg.norm(way, axis=1)
    assert scene.camera.contains(candidates.places).all()
    assert (way[:, 2] >= 0).all()
    assert LENGTHS_M[0] - 1e-6 <= length.min() < 0.06
    assert 0.18 < length.max() <= LENGTHS_M[1] + 1e-6


def test_places_near_the_rim_of_the_view_point_inwards(sheet_scene):
    scene = sheet_scene(centre=(0.16, 0.0))
    candidates = sample(scene, 1000, rng(), reachable=every_pull)
    assert scene.camera.contains(candidates.places).all()
    assert (candidates.places - candidates.picks)[:, 0].mean() < -0.01


def test_the_outline_is_picked_more_often_than_the_inside(scene):
    sheet = Scene(scene.mesh, scene.view)
    candidates = sample(sheet, 4000, rng(), reachable=every_pull)
    tree = KDTree(sheet.visible + np.array([0, 0, PICKER_ABOVE_M], np.float32))
    _, vertex = tree.query(candidates.picks)
    per_vertex = np.bincount(vertex, minlength=len(sheet.visible))
    low, high = sheet.visible[:, :2].min(axis=0), sheet.visible[:, :2].max(axis=0)
    outline = ((sheet.visible[:, :2] < low + 1e-4) | (sheet.visible[:, :2] > high - 1e-4)).any(axis=1)
    assert per_vertex[outline].mean() > 1.5 * per_vertex[~outline].mean()


def test_pixels_beside_the_cloth_meet_the_scene_5_mm_over_the_table(scene):
    beside = np.array([[2, 2], [scene.camera.width - 3, 5]])
    assert scene.view.depth[beside[:, 1], beside[:, 0]].max() == 0
    points = scene.surface(beside)
    np.testing.assert_allclose(points[:, 2], 0.005, atol=1e-9)
    np.testing.assert_allclose(scene.camera.project(points)[0], beside + 0.5, atol=1e-6)


def test_pixels_on_the_cloth_are_back_projected_with_their_depth(scene):
    rows, columns = np.nonzero(scene.view.depth)
    points = scene.surface(np.stack([columns, rows], axis=1))
    np.testing.assert_allclose(points, scene.camera.back_project(scene.view.depth)[rows, columns], atol=1e-6)


def test_depth_off_the_mask_is_not_cloth(scene):
    masked = scene.view.model_copy(update={"mask": np.zeros_like(scene.view.depth, bool)})
    rows, columns = np.nonzero(scene.view.depth)
    points = Scene(scene.mesh, masked).surface(np.stack([columns, rows], axis=1))
    np.testing.assert_allclose(points[:, 2], 0.005, atol=1e-9)


def test_the_box_has_a_margin_of_a_24th_of_the_image(scene):
    uv, _ = scene.camera.project(scene.mesh.vertices)
    low, high = scene.box
    margin = scene.camera.width / 24
    assert np.abs(uv.min(axis=0) - margin - low).max() <= 1
    assert np.abs(uv.max(axis=0) + margin - high).max() <= 1


def test_both_ends_are_within_reach_and_reach_is_asked_once_when_all_of_it_is(scene):
    asked = []

    def left_half(picks, places):
        asked.append(len(picks))
        return (picks[:, 0] < 0.02) & (places[:, 0] < 0.02)

    candidates = sample(scene, 300, rng(), reachable=left_half)
    assert len(candidates) == 300
    assert max(candidates.picks[:, 0].max(), candidates.places[:, 0].max()) < 0.02
    asked.clear()
    sample(scene, 300, rng(), reachable=lambda picks, places: asked.append(len(picks)) or anywhere(picks))
    assert asked == [300]


def test_same_seed_same_candidates(scene):
    one, two, other = (sample(scene, 50, rng(seed), reachable=every_pull) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.picks, two.picks)
    np.testing.assert_array_equal(one.places, two.places)
    assert (one.places != other.places).any()


def test_headings_are_uniform_in_the_plane():
    way = pulls(4000, 1, rng())[:, 0]
    assert np.abs(way[:, :2].mean(axis=0)).max() < 0.005
    assert way[:, 2].min() >= 0


def test_nothing_in_reach_is_said_so(scene):
    with pytest.raises(OutOfReach):
        sample(scene, 5, rng(), reachable=lambda picks, places: ~anywhere(picks))


def test_a_garment_outside_the_image_is_said_so(sheet_scene):
    scene = sheet_scene()
    away = scene.mesh.model_copy(update={"vertices": scene.mesh.vertices + np.array([1, 0, 0], np.float32)})
    with pytest.raises(NoGarment):
        sample(Scene(away, scene.view), 5, rng(), reachable=every_pull)


def test_a_mesh_without_visible_vertices_is_said_so(sheet_scene):
    scene = sheet_scene()
    hidden = scene.mesh.model_copy(update={"visible": np.zeros(len(scene.mesh.vertices), bool)})
    with pytest.raises(ReconstructionFailed):
        sample(Scene(hidden, scene.view), 5, rng(), reachable=every_pull)


def test_cloth_that_is_only_believed_in_is_not_picked(sheet_scene):
    """A mesh that lies 7 cm too far to the right is picked where it overlaps with what was seen."""
    scene = sheet_scene()
    aside = scene.mesh.model_copy(update={"vertices": scene.mesh.vertices + np.array([0.07, 0, 0], np.float32)})
    wrong = Scene(aside, scene.view)
    candidates = sample(wrong, 400, rng(), reachable=every_pull)
    edge = scene.mesh.vertices[:, 0].max()
    assert len(candidates) == 400
    assert wrong.visible[:, 0].max() > edge + 0.06
    assert edge < candidates.picks[:, 0].max() <= edge + REACH_M
    reached, _ = KDTree(scene.mesh.vertices).query(candidates.picks)
    assert (reached < REACH_M + 0.01).all()


def test_a_mesh_beside_the_garment_is_said_so(sheet_scene):
    scene = sheet_scene()
    beside = scene.mesh.model_copy(update={"vertices": scene.mesh.vertices * [1, 1, 0] + [0, 0, 0.05]})
    with pytest.raises(ReconstructionFailed, match="beside"):
        sample(Scene(beside, scene.view), 5, rng(), reachable=every_pull)


def test_what_was_seen_ends_with_the_mask(scene):
    half = np.zeros(scene.view.depth.shape, bool)
    half[:, : scene.camera.width // 2] = True
    masked = Scene(scene.mesh, scene.view.model_copy(update={"mask": half}))
    assert scene.seen[:, 0].max() > 0.025
    assert masked.seen[:, 0].max() <= 0
    assert masked.pickable[:, 0].max() <= REACH_M < scene.pickable[:, 0].max()


def test_depth_that_is_no_number_is_no_cloth(scene):
    depth = scene.view.depth.copy()
    depth[: len(depth) // 2] = np.inf
    depth[0] = np.nan
    broken = Scene(scene.mesh, scene.view.model_copy(update={"depth": depth}))
    assert 0 < len(broken.seen) < len(scene.seen)
    assert np.isfinite(broken.seen).all()
    assert len(sample(broken, 50, rng(), reachable=every_pull)) == 50


def test_the_random_policy_places_off_the_cloth(scene):
    for seed in range(20):
        action = random_action(scene, rng(seed), every_pull)
        distance, _ = KDTree(scene.mesh.vertices[:, :2]).query(action.places[:, :2])
        assert len(action) == 1
        assert distance[0] > CLEARANCE_M
        assert scene.camera.contains(action.places).all()
