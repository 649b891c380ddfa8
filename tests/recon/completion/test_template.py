import numpy as np
import pytest

from medor_cloth.garment import generate
from medor_cloth.nocs import NOCS
from medor_recon.completion.pixels import Pixels
from medor_recon.completion.template import FARTHEST, Templates, chamfer_matrix, medoids, one_way


@pytest.fixture(scope="module")
def garments():
    return [generate("tshirt", seed, edge_m=0.025) for seed in range(6)]


@pytest.fixture(scope="module")
def templates(garments) -> Templates:
    box = NOCS["tshirt"]
    return Templates.of(
        "tshirt", [g.seed for g in garments], [box.encode(g.vertices) for g in garments], [g.faces for g in garments]
    )


def half_seen(nocs: np.ndarray, noise: float = 0.0) -> Pixels:
    rng = np.random.default_rng(0)
    seen = nocs[nocs[:, 1] < 0.5]
    seen = (seen + rng.normal(0, noise, seen.shape)).astype(np.float32)
    return Pixels("tshirt", seen, seen, np.ones_like(seen), np.zeros((len(seen), 0), np.float32))


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_garment_of_which_the_front_is_seen_finds_itself(templates, noise):
    assert [templates.nearest(half_seen(templates[k][0], noise)) for k in range(len(templates))] == [*range(6)]


def test_points_that_are_not_sure_count_less(templates):
    own, other = half_seen(templates[2][0]), half_seen(templates[4][0])
    mixed = Pixels(
        "tshirt",
        np.concatenate([own.points, other.points]),
        np.concatenate([own.nocs, other.nocs]),
        np.concatenate([own.confidence, other.confidence * 0.01]),
        np.zeros((len(own.nocs) + len(other.nocs), 0), np.float32),
    )
    assert templates.nearest(mixed) == 2


def test_distances_are_those_to_the_nearest_vertex(templates):
    points = np.random.default_rng(1).random((20, 3)).astype(np.float32)
    found = one_way(points, templates.nocs, templates.first_vertex)
    for k in range(len(templates)):
        by_hand = np.linalg.norm(points[:, None] - templates[k][0][None], axis=2).min(axis=1)
        np.testing.assert_allclose(found[k], by_hand, atol=1e-5)
    assert found.max() > FARTHEST


def test_a_file_gives_the_same_library_back(templates, garments):
    packed = templates.to_bytes()
    again = Templates.from_bytes(packed)
    assert len(packed) < 40_000
    assert again.category == "tshirt"
    np.testing.assert_array_equal(again.seeds, templates.seeds)
    for k, garment in enumerate(garments):
        np.testing.assert_array_equal(again[k][1], garment.faces)
        np.testing.assert_array_equal(again[k][0], templates[k][0])
        np.testing.assert_allclose(again.canonical(k), garment.vertices, atol=2e-5)


def test_medoids_stand_for_groups():
    rng = np.random.default_rng(0)
    middles = (0.2, 0.2, 0.2, 0.2, 0.8, 0.8, 0.8)
    shapes = [rng.normal(middle, 0.01, (30, 3)) for middle in middles]
    chosen = medoids(shapes, 2)
    assert {chosen[0] < 4, chosen[1] < 4} == {True, False}
    assert medoids(shapes, 9) == [*range(7)]
    between = chamfer_matrix(shapes)
    np.testing.assert_allclose(between, between.T)
    np.testing.assert_allclose(np.diag(between), 0)
