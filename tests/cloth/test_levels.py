import numpy as np
import pytest

from medor_cloth.levels import Levels

TENTH_MM = Levels("uint16", 1e-4)


def test_values_come_back_within_half_a_unit():
    values = np.random.default_rng(0).uniform(0, 6.5, 10_000)
    assert np.abs(TENTH_MM.load(TENTH_MM.store(values)) - values).max() <= 0.5e-4 + 1e-6


def test_rounding_not_flooring():
    """Flooring would shift everything by half a unit; rounding shifts nothing on average."""
    values = np.random.default_rng(1).uniform(0.5, 0.6, 100_000)
    error = TENTH_MM.load(TENTH_MM.store(values)).astype(np.float64) - values
    assert abs(error.mean()) < 1e-6


def test_levels_survive_being_loaded_and_stored_again():
    levels = np.arange(65536, dtype=np.uint16)
    np.testing.assert_array_equal(TENTH_MM.store(TENTH_MM.load(levels)), levels)


@pytest.mark.parametrize("value", [-1e-3, 6.6, np.nan, np.inf])
def test_what_the_type_cannot_hold_is_refused(value):
    with pytest.raises(ValueError, match="expected values of 0 to 6"):
        TENTH_MM.store([0.1, value])
