import numpy as np
import pytest

from medor_cloth.grasp import grasp
from medor_sim.collect.carry import DISTANCE_PX, HEIGHT_M, PLACE_PX, SPEED_M, Carry, carry, carry_path, random_carry
from medor_sim.collect.harris import harris_corners
from medor_sim.collect.recon import CAMERA, look


@pytest.fixture(scope="module")
def flat_view(scene):
    return look(scene, scene.flat)


def test_picks_lie_on_the_cloth_and_places_in_the_allowed_window(scene, flat_view):
    for seed in range(30):
        move = random_carry(flat_view, CAMERA, np.random.default_rng(seed))
        pick_px, place_px = CAMERA.project(np.stack([move.pick, move.place]))[0]
        assert flat_view.mask[int(pick_px[1]), int(pick_px[0])]
        assert (place_px > PLACE_PX[0] - 3).all()
        assert (place_px < PLACE_PX[1] + 3).all()
        assert np.hypot(*(place_px - pick_px)) < DISTANCE_PX[1] + 4
        assert HEIGHT_M[0] <= move.height <= HEIGHT_M[1]


def test_carries_turn_towards_the_middle_of_the_image(scene, flat_view):
    """Clipping aside, no carry moves away from the optical axis to begin with."""
    for seed in range(30):
        move = random_carry(flat_view, CAMERA, np.random.default_rng(seed))
        assert (move.place - move.pick)[:2] @ -move.pick[:2] >= -0.003


def test_most_picks_are_corners(scene, flat_view):
    corners = harris_corners(flat_view.mask)
    share = corners.sum() / flat_view.mask.sum()
    picks = [random_carry(flat_view, CAMERA, np.random.default_rng(seed)).pick for seed in range(200)]
    pixels = CAMERA.project(np.stack(picks))[0].astype(int)
    at_corners = corners[pixels[:, 1], pixels[:, 0]].mean()
    assert at_corners == pytest.approx(0.9 + 0.1 * share, abs=0.1)


def test_the_path_goes_up_over_and_down_at_constant_speed():
    move = Carry(np.array([0.1, 0, 0.01]), np.array([-0.1, 0.1, 0.005]), 0.08)
    path = carry_path(move)
    steps = np.linalg.norm(np.diff(np.vstack([move.pick, path]), axis=0), axis=1)
    np.testing.assert_allclose(path[-1], move.place, atol=1e-6)
    assert steps.max() <= SPEED_M + 1e-6
    assert path[:, 2].max() == pytest.approx(0.08, abs=SPEED_M)
    high = path[path[:, 2] > 0.0799]
    assert np.linalg.norm(high[-1] - high[0]) == pytest.approx(np.hypot(0.2, 0.1), abs=2 * SPEED_M)


def test_a_carry_moves_the_cloth_that_was_taken(scene, flat_view):
    move = random_carry(flat_view, CAMERA, np.random.default_rng(4))
    after = carry(scene.solver, scene.flat, move)
    assert after is not None
    taken = grasp(scene.flat.positions, move.pick)
    before, left = (np.linalg.norm((x[taken] - move.place)[:2]) for x in (scene.flat.positions, after.positions))
    assert left < 0.4 * before, "it springs back a little where it is folded"
    assert not after.velocities.any()


def test_a_carry_beside_the_cloth_takes_nothing(scene):
    nowhere = Carry(np.array([0.25, 0.25, 0.005]), np.array([0.2, 0.2, 0.005]), 0.06)
    assert carry(scene.solver, scene.flat, nowhere) is None
