"""One figure a method: every task and category counts the same, and the interval says how far to trust it."""

import numpy as np
import pytest

from benchmarks.ablation import ablation, at_picks, interval
from benchmarks.episodes import Episode, episodes
from benchmarks.published import CATEGORIES, TASKS
from tests.benchmarks.made_up import lines, steady, trial


def full(method: str, rng: np.random.Generator, states: int, mean: float = 0.5, spread: float = 0.2) -> list[Episode]:
    """An episode in every cell for each state."""
    return [
        steady(mean + spread * rng.uniform(-1, 1), method=method, category=category, task=task, state=state)
        for state in range(states)
        for category in CATEGORIES
        for task in TASKS
    ]


def test_the_figure_is_the_mean_over_picks_3_5_and_10() -> None:
    found = episodes(lines(trial(), [0.0, 9.0, 9.0, 0.1, 9.0, 0.3, 9.0, 9.0, 9.0, 9.0, 0.8]), 10)
    assert ablation(found)[0].ni == pytest.approx(0.4)


def test_cells_count_the_same_however_many_episodes_they_have() -> None:
    found = [steady(0.9, state=state) for state in range(9)] + [steady(0.1, category="skirt")]
    row = ablation(found)[0]
    assert row.ni == pytest.approx(0.5)
    assert (row.cells, row.starts, row.episodes, row.complete) == (2, 10, 10, False)


def test_episodes_that_agree_leave_no_interval() -> None:
    assert interval(full("medor", np.random.default_rng(0), 3, spread=0.0)) == pytest.approx((0.5, 0.5))


def test_one_garment_says_nothing_of_others() -> None:
    assert interval([steady(0.3), steady(0.5, task="canonicalize")]) is None


def test_more_garments_narrow_the_interval_and_the_same_ones_give_the_same() -> None:
    few, many = (interval(full("medor", np.random.default_rng(1), states)) for states in (1, 16))
    assert few is not None
    assert many is not None
    assert many[1] - many[0] < 0.5 * (few[1] - few[0])
    assert few == interval(full("medor", np.random.default_rng(1), 1))


def test_the_interval_holds_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    intervals = [interval(full("medor", rng, 3)) for _ in range(60)]
    assert np.mean([low <= 0.5 <= high for low, high in filter(None, intervals)]) >= 0.88


def test_tasks_of_one_garment_are_drawn_together() -> None:
    rng = np.random.default_rng(3)
    alike, apart = [], []
    for state in range(12):
        first = rng.uniform(0, 1)
        alike += [steady(first, state=state), steady(first, state=state, task="canonicalize")]
        apart += [steady(first, state=state), steady(1 - first, state=state, task="canonicalize")]
    (low, high), (lower, higher) = interval(alike), interval(apart)  # type: ignore[misc]
    assert high - low > 0.1
    assert higher - lower < 1e-9


def test_a_share_of_the_oracle_is_on_what_both_met() -> None:
    oracle = [steady(0.8), steady(0.1, state=1)]
    assert ablation([*oracle, steady(0.4, method="medor")])[1].of_oracle == pytest.approx(0.5)
    assert ablation([*oracle, steady(0.4, method="medor", state=2)])[1].of_oracle is None
    assert ablation([steady(0.4, method="medor")])[0].of_oracle is None


def test_of_two_oracles_the_one_counts_that_met_more() -> None:
    oracles = [steady(0.8, candidates=50), steady(0.4, candidates=200), steady(0.8, candidates=50, state=1)]
    mine = [steady(0.4, method="medor", state=state) for state in (0, 1)]
    assert ablation([*oracles, *mine])[-1].of_oracle == pytest.approx(0.5)
    assert ablation([*oracles, mine[0]])[-1].of_oracle == pytest.approx(1.0)


def test_only_the_methods_of_the_paper_have_its_figures() -> None:
    found = [steady(0.5, method=method) for method in ("medor", "medor+physics", "joint+physics", "oracle", "visible")]
    found.append(steady(0.5, executor="panda"))
    published = {row.variant.label: row.published.ni for row in ablation(found) if row.published}
    assert published == {"medor": 0.651, "medor+physics": 0.631, "oracle": 0.870}


def test_a_shorter_protocol_has_fewer_picks_to_average() -> None:
    assert at_picks(episodes(lines(trial(picks=4), [0.0, 0.1, 0.2, 0.3, 0.4]), 4)[0]).tolist() == [0.3]
    assert at_picks(episodes(lines(trial(picks=1), [0.0, 0.1]), 1)[0]).tolist() == [0.1]
