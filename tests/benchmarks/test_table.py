"""The table's statistics: early stops carry forward, values clip at 1, medians are medians."""

import numpy as np
import pytest

from benchmarks.episodes import episodes
from benchmarks.results import Line
from benchmarks.table import category_cells, groups, markdown
from tests.benchmarks.made_up import lines, trial


def table(text: list[Line], picks: int) -> str:
    return markdown(category_cells(groups(episodes(text, picks)), picks))


def test_an_early_stop_keeps_its_last_value() -> None:
    one = groups(episodes(lines(trial(picks=5), [0.0, 0.5, 0.97]), picks=5))[0]
    np.testing.assert_allclose(one.curves, [[0.0, 0.5, 0.97, 0.97, 0.97, 0.97]])


def test_values_above_one_are_clipped_in_aggregation() -> None:
    assert "1.00 (1.00 to 1.00)" in table(lines(trial(picks=1), [0.0, 1.2]), 1)


def test_order_of_lines_does_not_matter() -> None:
    forward = lines(trial(picks=2), [0.0, 0.2, 0.4]) + lines(trial(picks=2, category="skirt"), [0.0, 0.1, 0.8])
    assert table(forward, 2) == table(forward[::-1], 2)


def test_the_table_states_median_and_quartiles() -> None:
    values = enumerate([0.1, 0.2, 0.3, 0.4, 0.9])
    text = [line for state, value in values for line in lines(trial(state=state, picks=1), [0.0, value])]
    assert "0.30 (0.20 to 0.40)" in table(text, 1)


def test_only_asked_pick_counts_are_columns() -> None:
    text = table(lines(trial(picks=3), [0.0, 0.2, 0.3, 0.4]), 3)
    assert "| NI@3 |" in text
    assert "| NI@5 |" not in text


def test_the_curve_of_all_categories_counts_each_the_same() -> None:
    text = [line for state in range(3) for line in lines(trial(state=state, picks=1), [0.0, 0.9])]
    text += lines(trial(category="skirt", picks=1), [0.0, 0.1])
    every = next(group for group in groups(episodes(text, 1)) if group.category == "all")
    assert every.mean.tolist() == pytest.approx([0.0, 0.5])


def test_numbers_of_candidates_are_never_mixed() -> None:
    text = lines(trial(candidates=30, picks=1), [0.0, 0.1]) + lines(trial(candidates=200, picks=1), [0.0, 0.9])
    assert [len(group.members) for group in groups(episodes(text, 1))] == [1, 1, 1, 1]


def test_the_papers_figures_stand_beside_the_methods_they_are_of() -> None:
    published = {
        group.variant.label: group.published
        for method in ("medor", "medor+physics", "visible")
        for group in groups(episodes(lines(trial(method), [0.0]), 10))
        if group.category == "tshirt"
    }
    assert published == {"medor": (0.59, 0.77, 0.96), "medor+physics": None, "visible": None}
