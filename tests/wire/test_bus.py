"""What every bus promises, proved on each of them."""

import threading
import time
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from medor_wire import endpoints, examples
from medor_wire.bus import Bus, Call, Instance
from medor_wire.codec import encode
from medor_wire.endpoints import ENDPOINTS, TOPICS, Endpoint, Topic
from medor_wire.errors import (
    Busy,
    Cancelled,
    InternalError,
    MedorError,
    Timeout,
    Unavailable,
    every_error,
)
from medor_wire.member import Member
from medor_wire.messages import (
    ActOutcome,
    ActRequest,
    CellStatus,
    Empty,
    GarmentId,
    Lease,
    LeaseRequest,
    Message,
    Reach,
    ReachRequest,
    RolloutProgress,
    Rollouts,
    UploadGarment,
)

Join = Callable[[str], Member]
STATUS = examples.STATUS


def eventually(condition: Callable[[], object], seconds: float = 3.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        time.sleep(0.005)


def serve(bus: Bus, endpoint: Endpoint, handler: Callable, **limits: int) -> Bus:
    bus.serve(endpoint, handler, **limits)
    bus.announce()
    return bus


def in_thread(action: Callable[[], object]) -> tuple[threading.Thread, list[object]]:
    """Run `action` beside the test; its result or its MedorError lands in the list."""
    result: list[object] = []

    def run() -> None:
        try:
            result.append(action())
        except MedorError as error:
            result.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, result


class Gate:
    """A handler that says when it has begun and waits to be let go."""

    def __init__(self, reply: Message = STATUS) -> None:
        self.reply = reply
        self.begun = threading.Semaphore(0)
        self.open = threading.Event()
        self.entered = 0
        self.calls: list[Call] = []

    def __call__(self, request: Message, call: Call) -> Message:
        self.entered += 1
        self.calls.append(call)
        self.begun.release()
        while not self.open.wait(0.005):
            call.check()
        return self.reply


# --- questions and answers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("endpoint", ENDPOINTS, ids=lambda endpoint: endpoint.name)
def test_every_endpoint_carries_its_example(join: Join, endpoint: Endpoint) -> None:
    exchange, seen = examples.EXCHANGES[endpoint], []

    def handler(request: Message, call: Call) -> Message:
        seen.append(request)
        if exchange.progress is not None:
            call.progress(exchange.progress)
        return exchange.reply

    serve(join("server"), endpoint, handler)
    progress: list[Message] = []
    reply = join("asker").ask(endpoint, exchange.request, on_progress=progress.append)
    assert [encode(message) for message in seen] == [encode(exchange.request)]
    assert encode(reply) == encode(exchange.reply)
    expected = [] if exchange.progress is None else [exchange.progress]
    assert [encode(message) for message in progress] == [encode(message) for message in expected]


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_every_topic_carries_its_example(join: Join, topic: Topic) -> None:
    seen: list[Message] = []
    publisher, watcher = join("publisher"), join("watcher")
    watcher.subscribe(topic, seen.append)

    def arrived() -> bool:
        publisher.publish(topic, examples.CONTENTS[topic])
        time.sleep(0.02)
        return bool(seen)

    eventually(arrived)
    assert encode(seen[0]) == encode(examples.CONTENTS[topic])


def test_progress_arrives_in_order_while_the_handler_runs(join: Join) -> None:
    exchange = examples.EXCHANGES[endpoints.ROLLOUT]
    heard = threading.Event()

    def handler(request: Message, call: Call) -> Rollouts:
        for done in range(20):
            call.progress(RolloutProgress(done=done, total=20))
        assert heard.wait(5), "the asker heard nothing before the reply"
        return exchange.reply  # type: ignore[return-value]

    def listen(message: Message) -> None:
        seen.append(message)
        heard.set()

    serve(join("server"), endpoints.ROLLOUT, handler)
    seen: list[Message] = []
    join("asker").ask(endpoints.ROLLOUT, exchange.request, on_progress=listen)  # type: ignore[arg-type]
    assert seen == [RolloutProgress(done=done, total=20) for done in range(20)]


def test_many_askers_at_once_get_their_own_answers(join: Join) -> None:
    def handler(request: ReachRequest, call: Call) -> Reach:
        return Reach(reachable=request.points[:, 0] > 0)

    serve(join("server"), endpoints.REACH, handler, workers=4, queue=64)
    asker = join("asker")

    def ask(size: int) -> int:
        points = np.arange(3 * size, dtype=np.float32).reshape(size, 3)
        return len(asker.ask(endpoints.REACH, ReachRequest(points=points)).reachable)

    running = [in_thread(lambda size=size: [ask(size) for _ in range(5)]) for size in range(1, 13)]
    for size, (thread, result) in enumerate(running, start=1):
        thread.join(10)
        assert result == [[size] * 5]


def test_the_request_id_reaches_the_handler(join: Join) -> None:
    seen = []

    def handler(request: Empty, call: Call) -> CellStatus:
        seen.append(call.request_id)
        return STATUS

    serve(join("server"), endpoints.STATUS, handler)
    join("asker").ask(endpoints.STATUS, Empty(), request_id="episode-7")
    assert seen == ["episode-7"]


def test_a_message_of_the_wrong_type_is_not_sent(join: Join) -> None:
    with pytest.raises(TypeError, match="robot/status takes Empty, got ReachRequest"):
        join("asker").ask(endpoints.STATUS, examples.EXCHANGES[endpoints.REACH].request)  # type: ignore[arg-type]


# --- errors -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("code", sorted(every_error()))
def test_errors_come_back_as_the_class_that_was_raised(join: Join, code: str) -> None:
    error = every_error()[code]

    def handler(request: ActRequest, call: Call) -> ActOutcome:
        raise error(f"expected this, got that: {code}")

    serve(join("server"), endpoints.ACT, handler)
    with pytest.raises(error, match=f"expected this, got that: {code}") as raised:
        join("asker").ask(endpoints.ACT, examples.EXCHANGES[endpoints.ACT].request)  # type: ignore[arg-type]
    assert type(raised.value) is error


def test_a_defect_keeps_its_details_in_the_log(join: Join, capsys: pytest.CaptureFixture[str]) -> None:
    def handler(request: ActRequest, call: Call) -> ActOutcome:
        raise ZeroDivisionError("secret")

    serve(join("server"), endpoints.ACT, handler)
    with pytest.raises(InternalError, match="robot/act") as raised:
        join("asker").ask(endpoints.ACT, examples.EXCHANGES[endpoints.ACT].request, request_id="r-17")  # type: ignore[arg-type]
    assert "secret" not in str(raised.value)
    assert "r-17" in str(raised.value)
    log = "".join(capsys.readouterr())
    assert "ZeroDivisionError" in log
    assert "secret" in log


# --- deadlines and cancellation -----------------------------------------------------------------------------------


def test_a_deadline_passes_while_the_handler_runs(join: Join) -> None:
    gate = Gate()
    serve(join("server"), endpoints.STATUS, gate)
    begun = time.monotonic()
    with pytest.raises(Timeout):
        join("asker").ask(endpoints.STATUS, Empty(), timeout_s=0.2)
    assert 0.15 < time.monotonic() - begun < 0.7
    eventually(lambda: gate.calls[0].cancelled())
    assert not gate.calls[0].withdrawn()


def test_what_expires_in_the_queue_is_never_begun(join: Join) -> None:
    gate = Gate()
    server = serve(join("server"), endpoints.STATUS, gate, workers=1, queue=4)
    asker = join("asker")
    first, answered = in_thread(lambda: asker.ask(endpoints.STATUS, Empty(), timeout_s=5))
    assert gate.begun.acquire(timeout=3)
    with pytest.raises(Timeout):
        asker.ask(endpoints.STATUS, Empty(), timeout_s=0.15)
    time.sleep(0.05)
    gate.open.set()
    first.join(3)
    assert answered == [STATUS]
    asker.ask(endpoints.STATUS, Empty())
    assert gate.entered == 2
    server.close()


def test_cancelling_reaches_the_handler(join: Join) -> None:
    gate, cancel = Gate(), threading.Event()
    serve(join("server"), endpoints.STATUS, gate)
    asker = join("asker")
    thread, result = in_thread(lambda: asker.ask(endpoints.STATUS, Empty(), cancel=cancel))
    assert gate.begun.acquire(timeout=3)
    cancel.set()
    thread.join(0.5)
    assert isinstance(result[0], Cancelled)
    assert gate.calls[0].withdrawn()


def test_what_is_cancelled_in_the_queue_is_never_begun(join: Join) -> None:
    gate, cancel = Gate(), threading.Event()
    serve(join("server"), endpoints.STATUS, gate)
    asker = join("asker")
    first, _ = in_thread(lambda: asker.ask(endpoints.STATUS, Empty()))
    assert gate.begun.acquire(timeout=3)
    second, result = in_thread(lambda: asker.ask(endpoints.STATUS, Empty(), cancel=cancel))
    time.sleep(0.1)
    cancel.set()
    time.sleep(0.1)
    gate.open.set()
    first.join(3)
    second.join(3)
    assert isinstance(result[0], Cancelled)
    assert gate.entered == 1


def test_what_is_cancelled_beforehand_is_not_sent(join: Join) -> None:
    gate, cancel = Gate(), threading.Event()
    cancel.set()
    serve(join("server"), endpoints.STATUS, gate)
    with pytest.raises(Cancelled, match="before it was sent"):
        join("asker").ask(endpoints.STATUS, Empty(), cancel=cancel)
    assert gate.entered == 0


def test_an_action_that_ends_in_spite_of_the_cancel_reports_its_outcome(join: Join) -> None:
    exchange, begun, cancel = examples.EXCHANGES[endpoints.ACT], threading.Event(), threading.Event()

    def handler(request: ActRequest, call: Call) -> ActOutcome:
        begun.set()
        eventually(call.withdrawn)
        return exchange.reply  # type: ignore[return-value]

    serve(join("server"), endpoints.ACT, handler)
    asker = join("asker")
    thread, result = in_thread(lambda: asker.ask(endpoints.ACT, exchange.request, cancel=cancel))  # type: ignore[arg-type]
    assert begun.wait(3)
    cancel.set()
    thread.join(3)
    assert result == [exchange.reply]


def test_an_asker_whose_listener_fails_withdraws_its_question(join: Join) -> None:
    exchange, withdrawn = examples.EXCHANGES[endpoints.ROLLOUT], threading.Event()

    def handler(request: Message, call: Call) -> Message:
        call.progress(RolloutProgress(done=0, total=1))
        eventually(call.withdrawn)
        withdrawn.set()
        call.check()
        raise AssertionError

    def fail(message: Message) -> None:
        raise KeyError("listener")

    serve(join("server"), endpoints.ROLLOUT, handler)
    with pytest.raises(KeyError, match="listener"):
        join("asker").ask(endpoints.ROLLOUT, exchange.request, on_progress=fail)  # type: ignore[arg-type]
    assert withdrawn.wait(3)


# --- admission ----------------------------------------------------------------------------------------------------


def test_more_than_workers_and_queue_is_turned_away_at_once(join: Join) -> None:
    gate = Gate(examples.OUTCOME)
    serve(join("server"), endpoints.ACT, gate, workers=2, queue=1)
    asker, request = join("asker"), examples.EXCHANGES[endpoints.ACT].request
    admitted = [in_thread(lambda: asker.ask(endpoints.ACT, request)) for _ in range(3)]  # type: ignore[arg-type]
    for _ in range(2):
        assert gate.begun.acquire(timeout=3)
    time.sleep(0.1)
    begun = time.monotonic()
    with pytest.raises(Busy):
        asker.ask(endpoints.ACT, request)  # type: ignore[arg-type]
    assert time.monotonic() - begun < 0.5
    gate.open.set()
    for thread, result in admitted:
        thread.join(3)
        assert result == [examples.OUTCOME]
    assert asker.ask(endpoints.ACT, request) == examples.OUTCOME  # type: ignore[arg-type]


# --- several instances --------------------------------------------------------------------------------------------


class Counting:
    """A handler that says which replica answered; a broken one answers nobody."""

    def __init__(self, broken: bool = False) -> None:
        self.asked = 0
        self.broken = broken

    def lease(self, request: LeaseRequest, call: Call) -> Lease:
        self.asked += 1
        if self.broken:
            raise Unavailable("broken")
        return Lease(epoch=1, ttl_s=2)

    def status(self, request: Empty, call: Call) -> CellStatus:
        self.asked += 1
        if self.broken:
            raise Unavailable("broken")
        return STATUS


def replicas(join: Join, endpoint: Endpoint, *handlers: Callable) -> Member:
    """One instance per handler; returns an asker who sees them all."""
    for index, handler in enumerate(handlers):
        serve(join(f"replica-{index}"), endpoint, handler)
    asker = join("asker")
    eventually(lambda: len(asker.instances(endpoint.service)) == len(handlers))
    return asker


def test_a_side_effect_happens_once_and_replicas_share_the_load(join: Join) -> None:
    one, two = Counting(), Counting()
    asker = replicas(join, endpoints.LEASE, one.lease, two.lease)
    for _ in range(20):
        asker.ask(endpoints.LEASE, LeaseRequest(holder="h"))
    assert (one.asked, two.asked) == (10, 10)


def test_reads_are_asked_again_of_another_instance(join: Join) -> None:
    broken, well = Counting(broken=True), Counting()
    asker = replicas(join, endpoints.STATUS, broken.status, well.status)
    assert all(asker.ask(endpoints.STATUS, Empty()) == STATUS for _ in range(10))
    assert well.asked == 10
    assert broken.asked == 1, "an instance that failed just now is asked last"


def test_reads_are_asked_three_times_at_most(join: Join) -> None:
    broken = [Counting(broken=True) for _ in range(4)]
    asker = replicas(join, endpoints.STATUS, *(each.status for each in broken))
    with pytest.raises(Unavailable, match="broken"):
        asker.ask(endpoints.STATUS, Empty())
    assert sorted(each.asked for each in broken) == [0, 1, 1, 1]


def test_a_lone_instance_that_says_it_cannot_is_believed(join: Join) -> None:
    broken = Counting(broken=True)
    asker = replicas(join, endpoints.STATUS, broken.status)
    with pytest.raises(Unavailable, match="broken"):
        asker.ask(endpoints.STATUS, Empty())
    assert broken.asked == 1


def test_side_effects_are_never_asked_again(join: Join) -> None:
    one, two = Counting(broken=True), Counting(broken=True)
    asker = replicas(join, endpoints.LEASE, one.lease, two.lease)
    with pytest.raises(Unavailable, match="broken"):
        asker.ask(endpoints.LEASE, LeaseRequest(holder="h"))
    assert one.asked + two.asked == 1


def test_a_named_instance_alone_is_asked(join: Join) -> None:
    one, two = Counting(), Counting(broken=True)
    asker = replicas(join, endpoints.STATUS, one.status, two.status)
    chosen = {instance.id: instance for instance in asker.instances("robot")}
    for _ in range(3):
        asker.ask(endpoints.STATUS, Empty(), instance=chosen["replica-0"])
    with pytest.raises(Unavailable, match="broken"):
        asker.ask(endpoints.STATUS, Empty(), instance=chosen["replica-1"])
    assert (one.asked, two.asked) == (3, 1)


def test_the_same_id_started_twice_is_two_instances(join: Join) -> None:
    one, two = Counting(), Counting()
    serve(join("robot"), endpoints.LEASE, one.lease)
    serve(join("robot"), endpoints.LEASE, two.lease)
    asker = join("asker")
    eventually(lambda: len(asker.instances("robot")) == 2)
    for _ in range(4):
        asker.ask(endpoints.LEASE, LeaseRequest(holder="h"))
    assert (one.asked, two.asked) == (2, 2)


# --- presence and health ------------------------------------------------------------------------------------------


def test_nobody_there_is_unavailable_soon(join: Join) -> None:
    begun = time.monotonic()
    with pytest.raises(Unavailable, match="nobody serves robot"):
        join("asker").ask(endpoints.STATUS, Empty(), timeout_s=30)
    assert time.monotonic() - begun < 1.5


def test_a_request_waits_a_moment_for_a_server_that_is_just_starting(join: Join) -> None:
    asker, server = join("asker"), join("server")
    thread, result = in_thread(lambda: asker.ask(endpoints.STATUS, Empty()))
    time.sleep(0.2)
    serve(server, endpoints.STATUS, lambda request, call: STATUS)
    thread.join(3)
    assert result == [STATUS]


def test_presence_comes_and_goes(join: Join) -> None:
    events: list[tuple[Instance, bool]] = []
    early = serve(join("early"), endpoints.STATUS, lambda request, call: STATUS)
    watcher = join("watcher")
    eventually(lambda: watcher.instances("robot"))
    watcher.on_presence(lambda instance, alive: events.append((instance, alive)))
    late = serve(join("late"), endpoints.SCORE, lambda request, call: examples.SCORE)
    eventually(lambda: len(events) == 2)
    early.close()
    eventually(lambda: len(events) == 3)
    first, second = Instance("robot", "early", early.boot), Instance("sim", "late", late.boot)
    assert events == [(first, True), (second, True), (first, False)]
    assert watcher.instances("robot") == []
    assert first.presence == early.presence


def test_one_process_may_serve_several_services(join: Join) -> None:
    sim = join("sim")
    sim.serve(endpoints.STATUS, lambda request, call: STATUS)
    sim.serve(endpoints.SCORE, lambda request, call: examples.SCORE)
    sim.announce()
    asker = join("asker")
    assert asker.ask(endpoints.STATUS, Empty()) == STATUS
    assert asker.ask(endpoints.SCORE, Empty()) == examples.SCORE
    assert {i.presence for s in ("robot", "sim") for i in asker.instances(s)} == {sim.presence}


def test_an_asker_learns_at_once_that_the_server_has_left(join: Join) -> None:
    begun, stuck = threading.Event(), threading.Event()

    def handler(request: UploadGarment, call: Call) -> GarmentId:
        begun.set()
        stuck.wait(10)
        raise AssertionError

    server = serve(join("server"), endpoints.UPLOAD_GARMENT, handler)
    asker, request = join("asker"), examples.EXCHANGES[endpoints.UPLOAD_GARMENT].request
    thread, result = in_thread(lambda: asker.ask(endpoints.UPLOAD_GARMENT, request))  # type: ignore[arg-type]
    assert begun.wait(3)
    left = time.monotonic()
    server.close()
    thread.join(5)
    assert isinstance(result[0], Unavailable)
    assert time.monotonic() - left < 4
    stuck.set()


def test_a_member_that_left_cannot_ask(join: Join) -> None:
    member = join("member")
    member.close()
    with pytest.raises(Unavailable, match="has left"):
        member.ask(endpoints.STATUS, Empty())


def test_heartbeats_say_whether_a_process_is_ready(join: Join) -> None:
    watcher, server = join("watcher"), join("server")
    server.ready(False, "compiling")
    serve(server, endpoints.STATUS, lambda request, call: STATUS)
    eventually(lambda: "robot/server" in watcher.health())
    assert not watcher.health()["robot/server"].ready
    assert watcher.health()["robot/server"].detail == "compiling"
    server.ready()
    eventually(lambda: watcher.health()["robot/server"].ready)
    health = watcher.health()["robot/server"]
    assert health.boot == server.boot
    assert health.age_s < 1.5


def test_a_server_that_leaves_hands_its_queue_back(join: Join) -> None:
    gate = Gate()
    server, other = serve(join("server"), endpoints.STATUS, gate), join("other")
    asker = join("asker")
    running = [in_thread(lambda: asker.ask(endpoints.STATUS, Empty())) for _ in range(3)]
    assert gate.begun.acquire(timeout=3)
    time.sleep(0.1)
    serve(other, endpoints.STATUS, lambda request, call: STATUS)
    eventually(lambda: len(asker.instances("robot")) == 2)
    server.close()
    for thread, result in running:
        thread.join(3)
        assert result == [STATUS]
    assert gate.entered == 1


def test_a_presence_callback_that_fails_is_called_again(join: Join) -> None:
    seen: list[Instance] = []

    def fails(instance: Instance, alive: bool) -> None:
        seen.append(instance)
        raise ZeroDivisionError

    join("watcher").on_presence(fails)
    for name in ("one", "two"):
        serve(join(name), endpoints.STATUS, lambda request, call: STATUS)
    eventually(lambda: len(seen) == 2)


# --- streams ------------------------------------------------------------------------------------------------------


def test_a_slow_watcher_misses_messages_and_sees_the_newest(join: Join) -> None:
    seen: list[int] = []

    def slow(message: ActOutcome) -> None:
        seen.append(int(message.action_id))
        time.sleep(0.05)

    publisher, watcher = join("publisher"), join("watcher")
    watcher.subscribe(endpoints.ACTION, slow)
    time.sleep(0.2)
    for number in range(100):
        publisher.publish(endpoints.ACTION, ActOutcome(action_id=str(number), grasped=True))
        time.sleep(0.002)
    eventually(lambda: seen and seen[-1] == 99)
    assert seen == sorted(set(seen))
    assert len(seen) < 30


def test_a_closed_subscription_is_silent(join: Join) -> None:
    seen: Counter[str] = Counter()
    publisher, watcher = join("publisher"), join("watcher")
    gone = watcher.subscribe(endpoints.ACTION, lambda message: seen.update(["gone"]))
    watcher.subscribe(endpoints.ACTION, lambda message: seen.update(["here"]))
    gone.close()

    def arrived() -> bool:
        publisher.publish(endpoints.ACTION, examples.OUTCOME)
        time.sleep(0.02)
        return seen["here"] > 2

    eventually(arrived)
    assert seen["gone"] == 0


def test_a_watcher_survives_its_own_defects(join: Join) -> None:
    seen: list[ActOutcome] = []

    def fails_once(message: ActOutcome) -> None:
        seen.append(message)
        if len(seen) == 1:
            raise ZeroDivisionError

    publisher, watcher = join("publisher"), join("watcher")
    watcher.subscribe(endpoints.ACTION, fails_once)

    def arrived() -> bool:
        publisher.publish(endpoints.ACTION, examples.OUTCOME)
        time.sleep(0.02)
        return len(seen) > 1

    eventually(arrived)
