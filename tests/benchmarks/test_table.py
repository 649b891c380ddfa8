"""The table's statistics: early stops carry forward, values clip at 1, medians are medians."""

import numpy as np

from benchmarks.table import curves, markdown


def lines(key: str, ni: list[float], method: str = "oracle", category: str = "tshirt") -> list[dict]:
    return [
        {
            "key": key,
            "method": method,
            "category": category,
            "task": "flatten",
            "pick": i,
            "ni": value,
            "seconds": 1.0,
            "last": i == len(ni) - 1,
        }
        for i, value in enumerate(ni)
    ]


def test_an_early_stop_keeps_its_last_value() -> None:
    values = curves(lines("a", [0.0, 0.5, 0.97]), picks=5)["oracle", "flatten", "tshirt"]
    np.testing.assert_allclose(values, [[0.0, 0.5, 0.97, 0.97, 0.97, 0.97]])


def test_values_above_one_are_clipped_in_aggregation() -> None:
    assert "1.00 (1.00 to 1.00)" in markdown(lines("a", [0.0, 1.2]), 1)


def test_order_of_lines_does_not_matter() -> None:
    forward = lines("a", [0.0, 0.2, 0.4]) + lines("b", [0.0, 0.1, 0.8], category="skirt")
    assert markdown(forward, 2) == markdown(forward[::-1], 2)


def test_the_table_states_median_and_quartiles() -> None:
    episodes = [line for k, v in enumerate([0.1, 0.2, 0.3, 0.4, 0.9]) for line in lines(str(k), [0.0, v])]
    assert "0.30 (0.20 to 0.40)" in markdown(episodes, 1)


def test_only_asked_pick_counts_are_columns() -> None:
    table = markdown(lines("a", [0.0, 0.2, 0.3, 0.4]), 3)
    assert "NI@3" in table
    assert "NI@5" not in table
