"""Admission at the door of one endpoint, without any wire."""

import threading
import time
from collections.abc import Iterator

import pytest

from medor_wire import codec, endpoints, examples
from medor_wire.bus import Call
from medor_wire.codec import encode
from medor_wire.envelope import Envelope
from medor_wire.errors import MedorError
from medor_wire.messages import Empty, Message
from medor_wire.server import Server


class Request:
    """A request that keeps what came back."""

    def __init__(self, ask: str = "a", seconds: float = 5.0, size: int | None = None) -> None:
        self.attachment = Envelope(ask, f"request-{ask}", time.time() + seconds, "asker/1").pack()
        self.size = len(encode(Empty())) if size is None else size
        self.read = 0
        self.outcomes: list[str] = []
        self.ended = threading.Event()

    def frame(self) -> bytes:
        self.read += 1
        return encode(Empty())

    def progress(self, frame: bytes) -> None: ...

    def reply(self, frame: bytes) -> None:
        self._end("ok")

    def fail(self, error: MedorError) -> None:
        self._end(error.code)

    def _end(self, outcome: str) -> None:
        self.outcomes.append(outcome)
        self.ended.set()


class Unsendable(Request):
    def reply(self, frame: bytes) -> None:
        self.ended.set()
        raise ConnectionError("the link is gone")


class Desk:
    """A server of `robot/status` with what it noted."""

    def __init__(self) -> None:
        self.open = threading.Event()
        self.notes: list[tuple[str, str, str]] = []
        self.defects: list[str] = []
        self.server = Server(
            endpoints.STATUS,
            self._handle,
            workers=1,
            queue=1,
            observe=lambda endpoint, request_id, seconds, outcome: self.notes.append((endpoint, request_id, outcome)),
            defect=lambda endpoint, request_id: self.defects.append(request_id),
        )

    def _handle(self, request: Message, call: Call) -> Message:
        while not self.open.wait(0.005):
            call.check()
        return examples.STATUS


@pytest.fixture
def desk() -> Iterator[Desk]:
    desk = Desk()
    yield desk
    desk.server.close(1.0)


def test_every_request_ends_exactly_once(desk: Desk) -> None:
    requests = [Request(str(number)) for number in range(6)]
    for request in requests:
        desk.server.offer(request)
    desk.open.set()
    assert all(request.ended.wait(3) for request in requests)
    desk.server.close(1.0)
    outcomes = [request.outcomes for request in requests]
    assert all(len(outcome) == 1 for outcome in outcomes)
    assert sorted(outcome for (outcome,) in outcomes) == ["busy"] * 4 + ["ok"] * 2
    assert sorted(outcome for _, _, outcome in desk.notes) == ["busy"] * 4 + ["ok"] * 2


def test_a_place_is_free_again_as_soon_as_the_reply_is_out(desk: Desk) -> None:
    desk.open.set()
    for number in range(50):
        request = Request(str(number))
        desk.server.offer(request)
        assert request.ended.wait(3)
        assert desk.server.busy == 0


def test_what_is_turned_away_is_not_even_read(desk: Desk) -> None:
    too_large = Request(size=codec.MAX_FRAME + 1)
    desk.server.offer(too_large)
    assert too_large.outcomes == ["bad_frame"]
    assert too_large.read == 0


def test_the_same_ask_twice_is_refused(desk: Desk) -> None:
    first, second = Request("same"), Request("same")
    desk.server.offer(first)
    desk.server.offer(second)
    assert second.outcomes == ["bad_frame"]
    desk.open.set()
    assert first.ended.wait(3)
    assert first.outcomes == ["ok"]


def test_a_lost_link_does_not_cost_a_worker(desk: Desk) -> None:
    desk.open.set()
    lost, well = Unsendable("lost"), Request("well")
    desk.server.offer(lost)
    assert lost.ended.wait(3)
    desk.server.offer(well)
    assert well.ended.wait(3)
    assert well.outcomes == ["ok"]
    assert desk.defects == ["request-lost"]


@pytest.mark.parametrize("withdraw", [True, False])
def test_withdrawing_ends_only_what_it_names(desk: Desk, withdraw: bool) -> None:
    running = Request("running")
    desk.server.offer(running)
    desk.server.withdraw("running" if withdraw else "another")
    assert running.ended.wait(0.3) == withdraw
    assert running.outcomes == (["cancelled"] if withdraw else [])


def test_closing_turns_everybody_away(desk: Desk) -> None:
    running, queued, late = Request("running"), Request("queued"), Request("late")
    desk.server.offer(running)
    desk.server.offer(queued)
    desk.server.close(1.0)
    desk.server.offer(late)
    assert [request.outcomes for request in (running, queued, late)] == [["unavailable"]] * 3
