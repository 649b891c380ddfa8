import numpy as np
import pytest

from medor_cloth.improvement import (
    carried_forward,
    normalized_improvement_canonical,
    normalized_improvement_flatten,
    quartiles,
)


def test_flattening_is_0_at_the_start_1_when_flat_and_linear_between():
    assert normalized_improvement_flatten(0.03, 0.03, 0.08) == 0
    assert normalized_improvement_flatten(0.08, 0.03, 0.08) == 1
    assert normalized_improvement_flatten(0.055, 0.03, 0.08) == pytest.approx(0.5)
    assert normalized_improvement_flatten(0.02, 0.03, 0.08) < 0
    assert normalized_improvement_flatten(0.09, 0.03, 0.08) > 1  # a skirt can be spread wider than flat


def test_improvement_does_not_depend_on_the_unit_of_area():
    cov, start, flat = np.array([0.04, 0.05, 0.07]), 0.03, 0.08
    np.testing.assert_allclose(
        normalized_improvement_flatten(cov * 1e4, start * 1e4, flat * 1e4),
        normalized_improvement_flatten(cov, start, flat),
    )


def test_canonicalizing_is_0_at_the_start_1_at_the_goal_and_negative_when_worse():
    np.testing.assert_allclose(normalized_improvement_canonical([0.1, 0.05, 0, 0.2], 0.1), [0, 0.5, 1, -1])


def test_a_start_that_cannot_be_improved_is_refused():
    with pytest.raises(ValueError, match="covers less than flat"):
        normalized_improvement_flatten(0.05, 0.08, 0.08)
    with pytest.raises(ValueError, match="away from the goal"):
        normalized_improvement_canonical(0.1, 0.0)
    with pytest.raises(ValueError, match="covers less than flat"):
        normalized_improvement_flatten(0.05, np.nan, 0.08)


def test_an_episode_that_stopped_early_keeps_its_last_value():
    np.testing.assert_array_equal(carried_forward([0, 0.4, 0.97], 5), [0, 0.4, 0.97, 0.97, 0.97, 0.97])
    np.testing.assert_array_equal(carried_forward([0, 0.4], 1), [0, 0.4])
    with pytest.raises(ValueError, match="1 to 2 values"):
        carried_forward([0, 0.1, 0.2], 1)
    with pytest.raises(ValueError):
        carried_forward([], 1)


def test_values_are_clipped_at_1_when_episodes_are_put_together():
    np.testing.assert_allclose(quartiles([0.2, 1.4, 1.8]), [0.6, 1.0, 1.0])
    curves = np.random.default_rng(0).uniform(-0.5, 1, (9, 11))
    low, median, high = quartiles(curves)
    assert low.shape == (11,)
    assert (low <= median).all()
    assert (median <= high).all()
    np.testing.assert_allclose(median, np.median(curves, axis=0))
