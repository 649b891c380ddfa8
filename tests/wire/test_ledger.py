"""At most once: no action runs twice, whatever happens between asking and answering."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from medor_wire.errors import Busy, IdReused, OutcomeUnknown, OutOfReach
from medor_wire.ledger import Ledger
from medor_wire.messages import ActOutcome, ActRequest


def request(action_id: str = "a", pick: tuple[float, float, float] = (0.1, 0.2, 0.01), epoch: int = 1) -> ActRequest:
    return ActRequest(action_id=action_id, epoch=epoch, pick=np.array(pick), place=np.array([0.3, 0.0, 0.05]))


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    ledger = Ledger(tmp_path / "ledger.db")
    yield ledger
    ledger.close()


class Arm:
    """Counts how often it moved."""

    def __init__(self) -> None:
        self.moves = 0

    def __call__(self) -> ActOutcome:
        self.moves += 1
        return ActOutcome(action_id="a", grasped=True, seconds=1.25)


def test_the_same_action_again_gets_the_recorded_outcome_and_moves_nothing(ledger: Ledger) -> None:
    arm = Arm()
    first = ledger.once(request(), arm)
    again = ledger.once(request(epoch=2), arm)
    assert arm.moves == 1
    assert not first.replayed
    assert again == first.model_copy(update={"replayed": True})


def test_the_same_id_with_another_pick_is_refused(ledger: Ledger) -> None:
    arm = Arm()
    ledger.once(request(), arm)
    with pytest.raises(IdReused):
        ledger.once(request(pick=(0.1, 0.2, 0.0100001)), arm)
    assert arm.moves == 1


def test_the_same_id_with_another_executor_is_refused(ledger: Ledger) -> None:
    arm = Arm()
    ledger.once(request(), arm)
    with pytest.raises(IdReused):
        ledger.once(request().model_copy(update={"executor": "panda"}), arm)
    assert arm.moves == 1


def test_a_failure_is_an_outcome_too(ledger: Ledger) -> None:
    moves = []

    def fail() -> ActOutcome:
        moves.append(1)
        raise OutOfReach("0.9 m away, 0.8 m at most")

    for _ in range(2):
        with pytest.raises(OutOfReach, match=r"0\.9 m away"):
            ledger.once(request(), fail)
    assert len(moves) == 1


def test_a_defect_during_motion_leaves_the_outcome_unknown(ledger: Ledger) -> None:
    with pytest.raises(ZeroDivisionError):
        ledger.once(request(), lambda: 1 // 0)  # type: ignore[arg-type, return-value]
    with pytest.raises(OutcomeUnknown):
        ledger.once(request(), Arm())


def test_concurrent_copies_execute_once(ledger: Ledger) -> None:
    arm, started, finish = Arm(), threading.Event(), threading.Event()

    def slow() -> ActOutcome:
        started.set()
        assert finish.wait(5)
        return arm()

    first = threading.Thread(target=ledger.once, args=(request(), slow))
    first.start()
    assert started.wait(5)
    for _ in range(9):
        with pytest.raises(Busy):
            ledger.once(request(), arm)
    finish.set()
    first.join()
    assert ledger.once(request(), arm).replayed
    assert arm.moves == 1


def test_outcomes_survive_a_restart(tmp_path: Path) -> None:
    arm = Arm()
    for _ in range(2):
        ledger = Ledger(tmp_path / "ledger.db")
        outcome = ledger.once(request(), arm)
        ledger.close()
    assert arm.moves == 1
    assert outcome.replayed
    assert outcome.seconds == 1.25


def test_epochs_only_grow_even_over_restarts(tmp_path: Path) -> None:
    epochs = []
    for _ in range(3):
        ledger = Ledger(tmp_path / "ledger.db")
        epochs += [ledger.next_epoch(), ledger.next_epoch()]
        ledger.close()
    assert epochs == sorted(set(epochs))


def test_a_second_process_cannot_own_the_ledger(ledger: Ledger, tmp_path: Path) -> None:
    with pytest.raises(Busy, match="belongs to another"):
        Ledger(tmp_path / "ledger.db")


def _die_in_motion(path: Path) -> None:
    Ledger(path).once(request(), lambda: os.kill(os.getpid(), signal.SIGKILL))  # type: ignore[arg-type, return-value]


def test_killed_in_motion_the_outcome_is_unknown_and_never_run_again(tmp_path: Path) -> None:
    path = tmp_path / "ledger.db"
    process = multiprocessing.get_context("spawn").Process(target=_die_in_motion, args=(path,))
    process.start()
    process.join(30)
    assert process.exitcode == -signal.SIGKILL
    arm = Arm()
    for _ in range(2):
        ledger = Ledger(path)
        with pytest.raises(OutcomeUnknown):
            ledger.once(request(), arm)
        ledger.close()
    assert arm.moves == 0
