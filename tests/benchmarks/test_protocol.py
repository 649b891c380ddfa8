"""A key names one trial and no other."""

import pytest

from benchmarks.protocol import Trial, trials


@pytest.mark.parametrize(
    "trial",
    [
        Trial("oracle", "tshirt", "flatten", 0, "drop", 10, 100),
        Trial("medor+physics", "skirt", "canonicalize", 12, "picks", 3, 500),
        Trial("no-relative", "dress", "flatten", 1, "drop", 10, 30, executor="panda"),
        Trial("visible", "jumpsuit", "flatten", 1, "flat", 10, 30, "panda", "bullet", 0.25),
        Trial("medor", "tshirt", "flatten", 0, "drop", 10, 500, exhaustive=True),
    ],
)
def test_a_trial_is_told_by_its_key(trial: Trial) -> None:
    assert Trial.of(trial.key) == trial


def test_trials_have_keys_of_their_own() -> None:
    every = list(trials(("a", "b"), ("skirt", "dress"), ("flatten",), 2, "drop", 3, 4, ("picker", "panda")))
    assert len({trial.key for trial in every}) == len(every) == 16


@pytest.mark.parametrize("key", ["", "oracle", "oracle/tshirt/flatten/drop0/p10", "a/b/c/drop0/p1/k1/martian"])
def test_what_is_no_key_is_refused(key: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        Trial.of(key)
