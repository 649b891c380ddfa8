"""Two tables of one paper agree with each other."""

import numpy as np
import pytest

from benchmarks.published import ABLATION, BY_CATEGORY, CATEGORIES, METHODS, TASKS, by_category


@pytest.mark.parametrize("method", BY_CATEGORY)
def test_the_table_by_category_averages_to_the_ablation_table(method: str) -> None:
    every = [by_category(method, task, category) for task in TASKS for category in CATEGORIES]
    assert np.mean(every) == pytest.approx(ABLATION[method].ni, abs=0.015)  # type: ignore[arg-type]


@pytest.mark.parametrize("task", TASKS)
def test_all_is_the_mean_of_the_categories(task: str) -> None:
    every = [by_category("medor", task, category) for category in CATEGORIES]
    assert by_category("medor", task, "all") == pytest.approx(np.mean(every, axis=0), abs=1e-3)  # type: ignore[arg-type]


def test_every_published_method_is_a_row() -> None:
    assert set(ABLATION) <= set(METHODS)
