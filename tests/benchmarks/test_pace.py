"""The time left is told by method."""

import pytest

from benchmarks.pace import Pace
from tests.benchmarks.made_up import lines, trial


def test_nothing_is_known_before_the_first_episode() -> None:
    assert Pace([]).left([trial()]) is None


def test_each_method_takes_its_own_time() -> None:
    pace = Pace(lines(trial("oracle"), [0.0, 0.1, 0.2]))  # 1 + 2 + 3 s
    pace.add(trial("random"), 1.0)
    assert pace.left([trial("oracle", state=1), trial("random", state=1), trial("random", state=2)]) == pytest.approx(8)


def test_a_method_not_met_before_takes_the_mean_of_the_others() -> None:
    pace = Pace([])
    pace.add(trial("oracle"), 9.0)
    pace.add(trial("random"), 1.0)
    pace.add(trial("random", state=1), 1.0)
    assert pace.left([trial("medor")]) == pytest.approx(5.0)


def test_nothing_left_takes_no_time() -> None:
    assert Pace(lines(trial(), [0.0])).left([]) == 0
