import numpy as np
import pytest

from medor_cloth.garment import CATEGORIES, generate
from medor_cloth.nocs import NOCS, STORED, NocsBox, box_around


@pytest.mark.parametrize("category", CATEGORIES)
def test_garments_kept_for_tests_fit_into_the_cube(category):
    for seed in range(800_000, 800_003):
        q = NOCS[category].encode(generate(category, seed, 0.025).vertices)
        assert q.min() > 0
        assert q.max() < 1


@pytest.mark.parametrize("category", CATEGORIES)
def test_decoding_inverts_encoding_through_storage(category):
    box = NOCS[category]
    points = np.random.default_rng(0).uniform(box.lower, box.upper, (1000, 3))
    back = box.decode(STORED.load(STORED.store(box.encode(points))))
    np.testing.assert_allclose(back, points, atol=0.5 * box.side / 65535 + 1e-7)


def test_coordinates_are_rounded_not_floored():
    """The mean error of many points is far below half a level, so labels are not shifted to one side."""
    q = np.random.default_rng(1).uniform(0, 1, 200_000)
    shift = (STORED.load(STORED.store(q)).astype(np.float64) - q).mean()
    assert abs(shift) < 0.01 / 65535


def test_the_cube_keeps_shape_and_leaves_a_margin():
    box = NocsBox((-0.2, -0.05, -0.1), (0.2, 0.05, 0.3))
    q = box.encode([box.lower, box.upper])
    np.testing.assert_allclose(q[1] - q[0], np.array([0.4, 0.1, 0.4]) / 0.5, rtol=1e-6)
    np.testing.assert_allclose(q.mean(0), 0.5, atol=1e-6)


def test_the_box_contains_what_it_was_made_of():
    box = box_around("skirt", range(2), edge_m=0.03)
    for seed in range(2):
        vertices = generate("skirt", seed, 0.03).vertices
        assert (vertices >= box.lower).all()
        assert (vertices <= box.upper).all()
    assert max(box.upper) < 0.5
