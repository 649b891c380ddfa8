"""Whatever is done to an observation, a point of the cloth stays where its canonical coordinates say."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from medor_cloth.winding import winding_numbers
from medor_recon.completion.augment import Augmentation, example, varied
from medor_recon.completion.observations import Observation, Prediction, observations, split
from medor_recon.completion.queries import on_surface, queries, winding_at
from medor_recon.completion.turn import MIRRORED, NONE, turns, winning

EXACT = Augmentation(predicted=0, spread=(0.0,), bend=0, outliers=0, turned=0.5, mirrored=0.5, offset=0.03, noise=0)


@pytest.fixture(scope="module")
def observation(data) -> Observation:
    return observations(data, ("tshirt",), 0.01)[2]


@pytest.mark.parametrize("seed", range(6))
def test_pixels_stay_on_the_vertices_of_equal_coordinates(observation, seed):
    item = varied(observation, None, EXACT, np.random.default_rng(seed))
    near, at = KDTree(item.nocs).query(item.pixels.nocs)
    close = near < 0.01
    assert close.sum() > 20
    distance = np.linalg.norm(item.pixels.points - item.positions[at], axis=1)[close]
    assert distance.mean() < 0.008


@pytest.mark.parametrize("seed", range(4))
def test_winding_numbers_turn_with_the_shape(observation, seed):
    rng = np.random.default_rng(seed)
    item = varied(observation, None, EXACT, rng)
    asked = queries(item, observation.shape.winding, rng, volume=400, surface=10)
    exact = winding_numbers(asked.volume, item.nocs, item.faces)
    assert np.abs(asked.winding - exact).mean() < 0.01
    assert np.median(exact[asked.winding > 0.6]) > 0.5


def test_the_same_draw_is_the_same_example(observation):
    one, two = (varied(observation, None, Augmentation(), np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one.pixels.nocs, two.pixels.nocs)
    np.testing.assert_array_equal(one.positions, two.positions)


def test_confidence_falls_where_coordinates_are_wrong(observation):
    augmentation = Augmentation(turned=0, mirrored=0, spread=(0.05,))
    item = varied(observation, None, augmentation, np.random.default_rng(0))
    wrong = np.linalg.norm(item.pixels.nocs - observation.true.nocs, axis=1)
    assert np.corrcoef(wrong, item.pixels.confidence.mean(axis=1))[0, 1] < -0.5


def test_surface_queries_carry_the_position_of_their_point(observation):
    item = example(observation)
    nocs, positions = on_surface(item, np.random.default_rng(0), 300)
    distance, at = KDTree(item.nocs).query(nocs)
    assert distance[::2].max() < 0.04
    assert np.linalg.norm(positions - item.positions[at], axis=1)[::2].max() < 0.03
    on, _ = on_surface(item, np.random.default_rng(0), 300, push=0)
    np.testing.assert_array_equal(on[::2], nocs[::2])
    off = np.linalg.norm(on[1::2] - nocs[1::2], axis=1)
    assert 0.005 < off.mean() < 0.012


def test_winding_between_the_nodes_is_linear():
    ramp = np.tile(np.linspace(0, 1, 5)[:, None, None], (1, 5, 5))
    np.testing.assert_allclose(winding_at(ramp, np.array([[0.3, 0.9, 0.1], [1.0, 0, 0]])), [0.3, 1.0], atol=1e-6)


@pytest.mark.parametrize("category", ["tshirt", "skirt"])
def test_turns_form_a_group_and_the_winning_one_is_found(category):
    nocs = np.random.default_rng(0).random((50, 3)).astype(np.float32)
    for turn in turns(category):
        np.testing.assert_allclose(turn.then(turn.back)(nocs), nocs, atol=1e-5)
        assert not turn.mirrors
        found = winning(category, turn(nocs) + 0.01, nocs)
        np.testing.assert_allclose(found.matrix, turn.matrix)
    assert len(turns(category)) == {"tshirt": 2, "skirt": 12}[category]


def test_a_mirrored_mesh_is_still_wound_outwards(observation):
    shape = observation.shape
    inside = np.array([[0.5, 0.5, 0.5]])
    true = winding_numbers(inside, shape.nocs, shape.faces)
    mirrored = winding_numbers(MIRRORED(inside), MIRRORED(shape.nocs), MIRRORED.wind(shape.faces))
    assert mirrored == pytest.approx(true, abs=1e-5)


def test_a_prediction_is_learnt_in_its_own_turn(observation):
    half = turns("tshirt")[1]
    item = example(observation, Prediction(observation.true, half))
    np.testing.assert_array_equal(item.nocs, half(observation.shape.nocs))
    np.testing.assert_array_equal(item.positions, observation.positions)
    assert example(observation).turn is NONE


def test_no_garment_is_learnt_from_and_validated_on(data):
    found = observations(data, ("tshirt",), 0.02)
    learn, held_out = split(found, 0.1)
    assert len(learn) + len(held_out) == len(found) == 10
    seeds = [{one.shape.record.seed for one in part} for part in (learn, held_out)]
    assert seeds[0] & seeds[1] == set()
    assert all(seeds)
