"""A choice is judged by what it is worth, not by what was expected of it."""

import numpy as np
import pytest

from medor_planner.one_pull import Options, Records, Worth, lay_out, wanted
from medor_planner.sampling import Candidates
from medor_wire import endpoints
from medor_wire.messages import Empty

GAINS = np.array([0.3, -0.2, 0.1, 0.0])
PLACES = np.zeros((4, 3), np.float32)
WORTH = Worth(Candidates(PLACES, PLACES), GAINS)


def judged(rewards: list[float]):
    return WORTH.judge("some", "skirt", "flatten", 0, np.array(rewards))


def test_who_knows_the_truth_takes_the_best():
    one = judged([0.0, *GAINS])
    assert (one.gain, one.best, one.chance) == (0.3, 0.3, pytest.approx(0.05))
    assert one.rank == pytest.approx(1)


def test_who_has_it_upside_down_takes_the_worst():
    one = judged([-1.0, *-GAINS])
    assert (one.gain, one.rank) == (-0.2, pytest.approx(-1))


def test_doing_nothing_gains_nothing():
    assert judged([0.5, *GAINS]).gain == 0


def test_who_sees_no_difference_has_no_rank():
    assert judged([0.0, 0.0, 0.0, 0.0, 0.0]).rank == 0


def test_what_is_on_record_is_not_measured_again(tmp_path):
    records, options = Records(tmp_path), Options(methods=("some", "other"), categories=("skirt",), states=2)
    records.append(judged([0.0, *GAINS]))
    with (tmp_path / "decisions.jsonl").open("a") as file:
        file.write('{"method": "other", "cate')  # killed while it wrote
    done = {(it.method, it.category, it.task, it.state) for it in Records(tmp_path).found()}
    left = [(state, names) for _, _, state, names in wanted(options, done)]
    assert left == [(0, ["other"]), (1, ["some", "other"])]


def test_garments_may_be_unfolded_before_the_pull_that_is_measured(full_lab):
    bus = full_lab.bus
    lay_out(bus, Options(), "tshirt", "flatten", 0)
    as_dropped = bus.ask(endpoints.SCORE, Empty())
    lay_out(bus, Options(unfolded=1), "tshirt", "flatten", 0)
    assert bus.ask(endpoints.SCORE, Empty()).coverage_m2 != as_dropped.coverage_m2
    assert bus.ask(endpoints.SCORE, Empty()).flat_coverage_m2 == as_dropped.flat_coverage_m2
