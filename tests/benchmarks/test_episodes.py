"""Lines become episodes."""

from benchmarks.episodes import by_variant, episodes, seconds_per_pick
from tests.benchmarks.made_up import lines, trial


def test_an_episode_in_two_files_counts_once() -> None:
    text = lines(trial(), [0.0, 0.5])
    assert len(episodes(text + text, 10)) == 1


def test_other_protocols_are_left_out() -> None:
    text = [line for picks in (5, 10) for line in lines(trial(picks=picks), [0.0])]
    assert [one.trial.picks for one in episodes(text, 10)] == [10]
    assert episodes(text, 10, start="picks") == []


def test_the_table_has_its_order_whatever_was_run_first() -> None:
    methods = ("random", "mine", "medor", "oracle (panda)", "oracle")
    found = [one for method in methods for one in episodes(lines(trial(method), [0.0]), 10)]
    order = [variant.label for variant in by_variant(found)]
    assert order == ["oracle", "oracle (panda)", "medor", "random", "mine"]


def test_the_start_state_is_no_pick() -> None:
    assert seconds_per_pick(episodes(lines(trial(), [0.0, 0.1, 0.2]), 10)) == 2.5
    assert seconds_per_pick(episodes(lines(trial(), [0.0]), 10)) is None


def test_who_gave_up_is_known() -> None:
    found = episodes(lines(trial(), [0.0, 0.4], gave_up="no_garment"), 10)
    assert found[0].gave_up == "no_garment"
    assert found[0].ni[-1] == 0.4
