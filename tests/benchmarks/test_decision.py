"""What screening would have chosen, and what that is worth."""

import numpy as np
import pytest

from benchmarks.decision import NOTHING, Decision, chosen, survivors
from benchmarks.screening import interval

MODEL = np.array([0.9, 0.7, 0.5, 0.3])


def decision(screen: np.ndarray, *, nothing: float = 0.1, true: dict[int, float] | None = None) -> Decision:
    truth = {NOTHING: nothing, **dict(enumerate(MODEL))} if true is None else true
    return Decision(
        MODEL, screen, np.zeros(4), nothing, truth, planned=0, exhaustive_s=10.0, screen_s=1.0, planned_s=3.0
    )


def test_a_screen_that_agrees_chooses_as_the_model_does():
    for keep in (0.25, 0.5, 1.0):
        assert decision(2 * MODEL).loss(2 * MODEL, keep) == (0, 0)


def test_all_surviving_nothing_is_given_away_whatever_the_screen_thinks():
    assert decision(-MODEL).loss(-MODEL, 1.0) == (0, 0)


def test_the_more_survive_the_less_is_given_away():
    losses = [decision(-MODEL).loss(-MODEL, keep)[0] for keep in (0.25, 0.5, 0.75, 1.0)]
    assert losses == sorted(losses, reverse=True)
    assert losses[0] == pytest.approx((0.9 - 0.3) / 0.9)


def test_a_choice_gives_away_what_it_is_worse_by():
    assert [decision(MODEL).loss_of(choice)[0] for choice in (0, 2, NOTHING)] == pytest.approx(
        [0, 0.4 / 0.9, 0.8 / 0.9]
    )


def test_doing_nothing_survives_always():
    assert chosen(MODEL, -MODEL, nothing=0.4, keep=0.25) == NOTHING
    assert decision(-MODEL, nothing=0.4).loss(-MODEL, 0.25)[0] == pytest.approx(0.5 / 0.9)
    assert decision(MODEL, nothing=1.0).loss(-MODEL, 0.25) == (0, 0)


def test_where_the_model_errs_the_truth_may_gain():
    true = {0: 0.2, 3: 0.4}
    by_model, by_solver = decision(-MODEL, true=true).loss(-MODEL, 0.25)
    assert by_model > 0
    assert by_solver == pytest.approx(-1)


def test_distances_are_losses_too():
    """Rewards of `canonicalize` are minus distances."""
    far = Decision(-MODEL[::-1], MODEL, np.zeros(4), -1.0, dict(enumerate(-MODEL[::-1])), 0, 10.0, 1.0, 3.0)
    assert far.loss(-np.arange(4.0)[::-1], 0.25) == pytest.approx((2, 2))


def test_seconds_are_those_of_the_screen_and_of_what_it_leaves():
    assert decision(MODEL).seconds(0.5) == pytest.approx(1 + 5)
    assert survivors(500, 0.15) == 75
    assert survivors(7, 0.2) == 2


def test_an_interval_holds_the_mean_and_narrows_with_more_decisions():
    def ends(text: str) -> tuple[float, float]:
        low, high = text.split("(")[1].rstrip(")").split(" to ")
        return float(low), float(high)

    values = np.random.default_rng(0).normal(0.02, 0.01, 400)
    few, many = ends(interval(values[:20])), ends(interval(values))
    assert few[0] < 2 < few[1]
    assert many[1] - many[0] < few[1] - few[0]
