"""Foreseen beside actual changes of coverage."""

import numpy as np

from benchmarks.foresight import changes, table


def line(pick: int, coverage: float, **more: object) -> dict:
    told = {"key": "a", "method": "m", "task": "flatten", "pick": pick, "coverage_m2": coverage, "no_op": False}
    return told | more


def test_changes_are_shares_of_the_coverage_before():
    lines = [line(0, 0.1), line(1, 0.11, reward=0.12, no_op_reward=0.1), line(2, 0.099, reward=0.22, no_op_reward=0.2)]
    np.testing.assert_allclose(changes(lines)["m"], [[0.2, 0.1], [0.1, -0.1]])


def test_pulls_that_were_not_foreseen_or_not_made_do_not_count():
    lines = [
        line(0, 0.1),
        line(1, 0.2),
        line(2, 0.2, no_op=True, reward=0.1, no_op_reward=0.1),
        line(3, 0.3, reward=0.15, no_op_reward=0.1, task="canonicalize"),
    ]
    assert changes(lines) == {}


def test_episodes_do_not_mix():
    lines = [line(0, 0.1), line(0, 0.5, key="b"), line(1, 0.2, reward=0.2, no_op_reward=0.1)]
    np.testing.assert_allclose(changes(lines)["m"], [[1.0, 1.0]])


def test_the_table_has_a_row_a_quarter():
    pairs = np.stack([np.linspace(0, 0.4, 9), np.linspace(-0.1, 0.3, 9)], axis=1)
    rows = table({"m": pairs, "n": pairs[:1]})
    assert rows.row_count == 4 + 1
    assert next(iter(rows.columns[5].cells)) == "1.00"
