"""What becomes of trials in a cell that refuses, gives up, or breaks."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.closed_loop import ClosedLoop
from benchmarks.pictures import GAP_PX, SIDE_PX, moments, path
from benchmarks.protocol import Trial
from benchmarks.results import Results
from benchmarks.skips import Skips
from medor_cloth.camera import overhead
from medor_wire import endpoints
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, Busy, LeaseLost, MedorError, ReconstructionFailed, Timeout, Unavailable
from medor_wire.local_bus import LocalBus
from medor_wire.messages import CameraInfo, DepthView, Empty, Episode, EpisodePick, EpisodeProgress, EpisodeRequest
from tests.benchmarks.made_up import trial

CAMERA = overhead(90)
Ending = Callable[[EpisodeRequest], MedorError | None]


def view() -> DepthView:
    depth = np.full((90, 90), 0.62, np.float32)
    info = CameraInfo(K=CAMERA.K, T_world_camera=CAMERA.T_world_camera, width=90, height=90)
    return DepthView(depth=depth, mask=np.ones((90, 90), bool), camera=info)


class Cell:
    """Plays episodes of `picks` picks that gain 0.1 each; then they end as `ending` says."""

    def __init__(self, ending: Ending = lambda request: None, picks: int = 2) -> None:
        self.asked: list[EpisodeRequest] = []
        self._ending, self._picks = ending, picks

    def episode(self, request: EpisodeRequest, call: Call) -> Episode:
        self.asked.append(request)
        for index in range(self._picks + 1):
            seen = view() if index else None
            step = EpisodePick(index=index, coverage_m2=0.1, ni=0.1 * index, view=seen)
            call.progress(EpisodeProgress(step=step))
        if error := self._ending(request):
            raise error
        return Episode(ni=0.1 * self._picks, picks=(), flat_coverage_m2=0.1, reason="max_picks")


def run(
    cell: Cell, trials: list[Trial], folder: Path, patience_s: float = 0.5
) -> tuple[Results, dict[str, str], Skips, list[str]]:
    results, told = Results(folder / "picks.jsonl"), []
    results.keep_finished()
    skips = Skips(results.finished())
    with LocalBus() as bus:
        bus.serve(endpoints.EPISODE, cell.episode)
        bus.serve(endpoints.CAPTURE, lambda request, call: view())
        assert bus.ask(endpoints.CAPTURE, Empty()) == view()
        reasons = ClosedLoop(bus, folder, told.append, patience_s).run(trials, results, skips)
    return results, reasons, skips, told


def test_an_episode_leaves_a_line_a_pick_and_a_picture(tmp_path: Path) -> None:
    results, reasons, _, told = run(Cell(), [trial()], tmp_path)
    assert [(line["pick"], line["ni"], line["last"]) for line in results.lines()] == [
        (0, 0.0, False),
        (1, 0.1, False),
        (2, 0.2, True),
    ]
    assert reasons == {}
    assert len(told) == 3
    with Image.open(path(tmp_path, trial().key)) as picture:
        assert picture.size == (3 * SIDE_PX + 2 * GAP_PX, SIDE_PX)


def test_a_method_without_weights_is_asked_once_a_category_and_the_others_run(tmp_path: Path) -> None:
    cell = Cell(lambda request: BadRequest("no weights") if request.method == "medor" else None, picks=0)
    trials = [trial(method, state=state) for state in range(3) for method in ("medor", "random")]
    results, reasons, skips, _ = run(cell, trials, tmp_path)
    assert [request.method for request in cell.asked].count("medor") == 1
    assert results.finished() == {one.key for one in trials if one.method == "random"}
    assert set(reasons) == {one.key for one in trials if one.method == "medor"}
    assert all("no weights" in reason for reason in reasons.values())
    assert skips.reason(trial("medor", category="skirt")) is None


def test_a_method_that_has_worked_is_asked_again_after_a_refusal(tmp_path: Path) -> None:
    cell = Cell(lambda request: BadRequest("no coarse mesh") if request.seed == 1 else None)
    _, reasons, skips, _ = run(cell, [trial(state=state) for state in range(3)], tmp_path)
    assert list(reasons) == [trial(state=1).key]
    assert skips.reason(trial(state=1)) is None


def test_who_gives_up_keeps_what_was_reached(tmp_path: Path) -> None:
    results, reasons, _, _ = run(Cell(lambda request: ReconstructionFailed("far off")), [trial()], tmp_path)
    assert reasons == {}
    last = results.lines()[-1]
    assert (last["ni"], last["last"], last["gave_up"]) == (0.2, True, "reconstruction_failed")


class Forgetful(Cell):
    """Loses every episode the first time."""

    def __init__(self, error: MedorError) -> None:
        super().__init__(self._first)
        self._error = error

    def _first(self, request: EpisodeRequest) -> MedorError | None:
        return self._error if self.asked.count(request) == 1 else None


@pytest.mark.parametrize("error", [LeaseLost("by nobody"), Timeout("too late"), Unavailable("no answer")])
def test_what_is_lost_is_run_once_more_after_all_others(tmp_path: Path, error: MedorError) -> None:
    cell, trials = Forgetful(error), [trial(state=state) for state in range(2)]
    results, reasons, _, _ = run(cell, trials, tmp_path)
    assert [request.seed for request in cell.asked] == [0, 1, 0, 1]
    assert (results.finished(), reasons) == ({one.key for one in trials}, {})


def test_what_is_lost_twice_is_given_up(tmp_path: Path) -> None:
    cell = Cell(lambda request: Unavailable("gone"))
    _, reasons, _, _ = run(cell, [trial()], tmp_path)
    assert len(cell.asked) == 2
    assert list(reasons) == [trial().key]


def test_a_cell_that_breaks_leaves_nothing_and_is_tried_again(tmp_path: Path) -> None:
    results, reasons, skips, _ = run(Cell(lambda request: Unavailable("gone")), [trial()], tmp_path)
    assert results.finished() == set()
    assert list(reasons) == [trial().key]
    assert skips.reason(trial()) is None
    again, reasons, _, _ = run(Cell(), [trial()], tmp_path)
    assert again.finished() == {trial().key}
    assert reasons == {}


@pytest.mark.parametrize(("picks", "shown"), [(0, [0]), (1, [0, 1]), (4, [0, 1, 3, 4]), (10, [0, 1, 3, 5, 10])])
def test_pictures_begin_with_the_start_and_end_with_the_last_pick(picks: int, shown: list[int]) -> None:
    assert moments(picks) == shown


class Occupied(Cell):
    """Still at work on another episode, so many times that it is asked."""

    def __init__(self, times: int) -> None:
        super().__init__()
        self._times = times

    def episode(self, request: EpisodeRequest, call: Call) -> Episode:
        if self._times > 0:
            self._times -= 1
            raise Busy("another episode is going on")
        return super().episode(request, call)


def test_a_busy_cell_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.closed_loop.ASK_AGAIN_S", 0.01)
    results, reasons, _, told = run(Occupied(3), [trial(state=0), trial(state=1)], tmp_path)
    assert reasons == {}
    assert sum("waiting" in line for line in told) == 1
    assert len(results.finished()) == 2


def test_a_cell_that_stays_busy_is_not_waited_for_without_end(tmp_path: Path) -> None:
    results, reasons, _, _ = run(Occupied(1000), [trial()], tmp_path, patience_s=0.02)
    assert list(reasons) == [trial().key]
    assert not results.finished()
