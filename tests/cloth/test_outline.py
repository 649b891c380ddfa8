"""Curves keep their ends and their length."""

import numpy as np
import pytest

from medor_cloth.outline import arc, bezier, fillet, join, length, line, mirror, resample


def test_resampled_curve_keeps_its_ends_and_spacing():
    curve = arc(0.4, 1.2, centre_y=0.0)
    sampled = resample(curve, 17)
    assert sampled.shape == (18, 2)
    np.testing.assert_allclose(sampled[[0, -1]], curve[[0, -1]], atol=1e-12)
    steps = np.linalg.norm(np.diff(sampled, axis=0), axis=1)
    assert np.ptp(steps) < 0.01 * steps.mean()


def test_arc_has_the_length_of_its_angle_and_touches_below_its_centre():
    curve = arc(0.5, 0.8, centre_y=0.3, samples=401)
    assert length(curve) == pytest.approx(0.4, rel=1e-4)
    assert curve[:, 1].min() == pytest.approx(-0.2)


def test_mirror_twice_is_the_same_curve():
    curve = bezier((0.1, 0), (0.3, -0.2), (0.2, -0.5))
    np.testing.assert_array_equal(mirror(mirror(curve)), curve)


def test_bezier_of_degree_one_is_a_line_and_degree_two_touches_its_end_tangents():
    np.testing.assert_allclose(bezier((0, 0), (2, 2), samples=3), [[0, 0], [1, 1], [2, 2]])
    start = np.diff(bezier((0, 0), (1, 0), (1, 1), samples=1000)[:2], axis=0)[0]
    assert abs(start[1]) < 1e-2 * abs(start[0])


def test_fillet_cuts_the_corner_but_stays_near_it():
    rounded = fillet((0, 1), (0, 0), (1, 0), 0.2)
    np.testing.assert_array_equal(rounded[[0, -1]], [[0, 1], [1, 0]])
    distance = np.linalg.norm(rounded, axis=1).min()
    assert 0 < distance < 0.2


def test_join_does_not_repeat_shared_points():
    assert len(join(line((0, 0), (1, 0)), line((1, 0), (1, 1)), line((1, 1), (0, 1)))) == 4
