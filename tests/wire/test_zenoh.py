"""What can go wrong between processes: killed, stopped, stalled, restarted, fed with garbage."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgpack
import numpy as np
import pytest
import zenoh

from medor_wire import endpoints, examples
from medor_wire.bus import Bus, Call
from medor_wire.codec import encode
from medor_wire.config import BusConfig
from medor_wire.envelope import Envelope
from medor_wire.errors import MedorError, OutcomeUnknown, Timeout, Unavailable
from medor_wire.holding import Holding
from medor_wire.member import Member
from medor_wire.messages import ActRequest, EmergencyStop, Empty, ReachRequest, Score
from medor_wire.zenoh_bus import ZenohBus
from medor_wire.zenoh_config import client_config, router_config
from tests.wire import processes
from tests.wire.conftest import free_port
from tests.wire.test_bus import eventually, in_thread

Join = Callable[[str], Member]


def present(bus: Bus, service: str) -> None:
    eventually(lambda: bus.instances(service), 20)


def action(action_id: str) -> ActRequest:
    return ActRequest(action_id=action_id, epoch=0, pick=np.zeros(3), place=np.ones(3))


# --- servers that die, stop and stall -----------------------------------------------------------------------------


def test_a_killed_server_is_unavailable_fast_and_so_is_everybody_after(
    zenoh_join: Join, cell_config: BusConfig
) -> None:
    asker = zenoh_join("asker")
    with processes.running(processes.status, cell_config) as server:
        present(asker, "robot")
        thread, result = in_thread(lambda: asker.ask(endpoints.CAPTURE, Empty(), timeout_s=30))
        time.sleep(0.2)
        killed = time.monotonic()
        server.kill()
        thread.join(5)
        assert isinstance(result[0], Unavailable)
        assert not isinstance(result[0], Timeout)
        eventually(lambda: not asker.instances("robot"), 1)
        # The read looks for another instance for a second before it gives up.
        assert time.monotonic() - killed < 2


def test_a_stopped_server_is_a_timeout(zenoh_join: Join, cell_config: BusConfig) -> None:
    asker = zenoh_join("asker")
    with processes.running(processes.status, cell_config) as server:
        present(asker, "robot")
        os.kill(server.pid or 0, signal.SIGSTOP)
        begun = time.monotonic()
        with pytest.raises(Timeout):
            asker.ask(endpoints.STATUS, Empty(), timeout_s=0.5)
        assert time.monotonic() - begun < 1
        # Zenoh's own default would take ten seconds to notice.
        eventually(lambda: not asker.instances("robot"), 4)
        os.kill(server.pid or 0, signal.SIGCONT)
        present(asker, "robot")
        assert asker.ask(endpoints.STATUS, Empty()) == examples.STATUS


def test_a_stalled_server_is_present_but_its_heart_does_not_beat(zenoh_join: Join, cell_config: BusConfig) -> None:
    asker = zenoh_join("asker")
    with processes.running(processes.status, cell_config):
        present(asker, "robot")
        eventually(lambda: "robot/status" in asker.health())
        stall = ReachRequest(points=np.array([[2.5, 0, 0]]))
        thread, result = in_thread(lambda: asker.ask(endpoints.REACH, stall))
        eventually(lambda: asker.health()["robot/status"].age_s > 1.8, 5)
        assert asker.instances("robot"), "presence says nothing about health"
        thread.join(5)
        assert not isinstance(result[0], MedorError)
        eventually(lambda: asker.health()["robot/status"].age_s < 0.5)


# --- actions --------------------------------------------------------------------------------------------------------


def test_an_action_interrupted_by_a_kill_is_unknown_and_never_repeated(
    zenoh_join: Join, cell_config: BusConfig, tmp_path: Path
) -> None:
    ledger, log = tmp_path / "ledger.db", tmp_path / "log"
    planner = zenoh_join("planner")
    with processes.running(processes.robot, cell_config, ledger, log) as robot:
        present(planner, "robot")
        with Holding(planner) as held:
            thread, result = in_thread(lambda: held.act(action("a")))
            eventually(log.exists)
            robot.kill()
            thread.join(2)
            assert isinstance(result[0], Unavailable)
    eventually(lambda: not planner.instances("robot"))
    with processes.running(processes.robot, cell_config, ledger, log):
        present(planner, "robot")
        with Holding(planner) as held:
            for _ in range(2):
                with pytest.raises(OutcomeUnknown):
                    held.act(action("a"))
    assert log.read_text().count("move a") == 1


def test_a_robot_whose_holder_is_killed_stops(zenoh_join: Join, cell_config: BusConfig, tmp_path: Path) -> None:
    log = tmp_path / "log"
    watcher = zenoh_join("watcher")
    with processes.running(processes.robot, cell_config, tmp_path / "ledger.db", log):
        present(watcher, "robot")
        with processes.running(processes.holder, cell_config) as holder:
            eventually(log.exists, 20)
            killed = time.monotonic()
            holder.kill()
            eventually(lambda: "stop held lease_lost" in log.read_text())
    stopped = float(log.read_text().splitlines()[-1].split()[0])
    assert stopped - killed < 0.5, "by presence, long before the lease runs out"


def test_an_emergency_stop_reaches_a_moving_robot(zenoh_join: Join, cell_config: BusConfig, tmp_path: Path) -> None:
    log = tmp_path / "log"
    planner = zenoh_join("planner")
    with processes.running(processes.robot, cell_config, tmp_path / "ledger.db", log):
        present(planner, "robot")
        with Holding(planner) as held:
            thread, result = in_thread(lambda: held.act(action("a")))
            eventually(log.exists)
            stopped = time.monotonic()
            planner.publish(endpoints.STOP, EmergencyStop(reason="hand in the cell"))
            thread.join(2)
            assert getattr(result[0], "code", "") == "emergency_stopped"
            assert time.monotonic() - stopped < 0.5
        with Holding(planner) as again, pytest.raises(MedorError, match="hand in the cell"):
            again.act(action("b"))


# --- the router -----------------------------------------------------------------------------------------------------


def test_members_that_start_before_the_router_find_each_other() -> None:
    config = BusConfig(router=f"tcp/127.0.0.1:{free_port()}")
    joining = [in_thread(lambda id=id: ZenohBus(id, config)) for id in ("asker", "server")]
    time.sleep(0.5)
    with zenoh.open(router_config(config.router)):
        for thread, _ in joining:
            thread.join(5)
        asker, server = (result[0] for _, result in joining)
        assert isinstance(asker, ZenohBus)
        assert isinstance(server, ZenohBus)
        with asker, server:
            server.serve(endpoints.STATUS, lambda request, call: examples.STATUS)
            server.announce()
            assert asker.ask(endpoints.STATUS, Empty()) == examples.STATUS


def test_without_a_router_patience_ends() -> None:
    begun = time.monotonic()
    with pytest.raises(Unavailable, match="no router at"):
        ZenohBus("asker", BusConfig(router=f"tcp/127.0.0.1:{free_port()}"), patience_s=0)
    assert time.monotonic() - begun < 2


def test_the_bus_recovers_from_a_killed_router() -> None:
    config = BusConfig(router=f"tcp/127.0.0.1:{free_port()}")
    stuck = threading.Event()

    def hang(request: Empty, call: Call) -> Score:
        stuck.wait(10)
        return examples.SCORE

    with contextlib.ExitStack() as members:
        with processes.running(processes.router, config.router) as router:
            asker = members.enter_context(ZenohBus("asker", config))
            server = members.enter_context(ZenohBus("server", config))
            members.callback(stuck.set)
            server.serve(endpoints.STATUS, lambda request, call: examples.STATUS)
            server.serve(endpoints.SCORE, hang)
            server.announce()
            seen: list[object] = []
            asker.subscribe(endpoints.CELL, seen.append)
            present(asker, "robot")
            thread, result = in_thread(lambda: asker.ask(endpoints.SCORE, Empty(), timeout_s=30))
            time.sleep(0.2)
            router.kill()
            thread.join(3)
            assert isinstance(result[0], Unavailable)
            eventually(lambda: not asker.instances("robot"))
        with processes.running(processes.router, config.router):
            present(asker, "robot")
            assert asker.ask(endpoints.STATUS, Empty()) == examples.STATUS

            def heard() -> bool:
                server.publish(endpoints.CELL, examples.STATUS)
                time.sleep(0.02)
                return bool(seen)

            eventually(heard)


# --- leaving --------------------------------------------------------------------------------------------------------

SERVE_FOREVER = """
import sys
from medor_wire import endpoints, examples
from medor_wire.bus import join
from medor_wire.config import BusConfig
import time
def hang(request, call):
    time.sleep(600)
with join("status", BusConfig(router=sys.argv[1], cell=sys.argv[2])) as bus:
    bus.serve(endpoints.STATUS, hang)
    bus.subscribe(endpoints.CELL, print)
    bus.run()
print("left")
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_server_leaves_when_told_even_with_a_stuck_handler(
    zenoh_join: Join, cell_config: BusConfig, number: signal.Signals
) -> None:
    asker = zenoh_join("asker")
    command = [sys.executable, "-c", SERVE_FOREVER, cell_config.router, cell_config.cell]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            present(asker, "robot")
            with pytest.raises(Timeout):
                asker.ask(endpoints.STATUS, Empty(), timeout_s=0.1)
            server.send_signal(number)
            output, _ = server.communicate(timeout=8)
        finally:
            server.kill()
    assert output == "left\n"
    assert server.returncode == 0
    assert asker.instances("robot") == []


def test_a_session_that_nobody_closed_does_not_keep_a_process(cell_config: BusConfig) -> None:
    code = "import sys; from medor_wire.zenoh_bus import ZenohBus; from medor_wire.config import BusConfig; "
    code += "from medor_wire.endpoints import CELL; "
    code += (
        "bus = ZenohBus('a', BusConfig(router=sys.argv[1], cell=sys.argv[2])); bus.ready(); bus.subscribe(CELL, print)"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, cell_config.router, cell_config.cell], timeout=15, capture_output=True, check=False
    )
    assert run.returncode == 0, run.stderr


# --- garbage --------------------------------------------------------------------------------------------------------


def envelope(seconds: float = 1e6) -> bytes:
    return Envelope("ask", "request", time.time() + seconds, "asker/1").pack()


GARBAGE = {
    "no envelope": (None, encode(Empty()), "bad_frame"),
    "noise as envelope": (b"\xc1" * 30, encode(Empty()), "bad_frame"),
    "a list as envelope": (msgpack.Packer().pack([1, 2, 3]), encode(Empty()), "bad_frame"),
    "envelope of tomorrow": (
        msgpack.Packer().pack({"version": 2, "ask": "a", "request_id": "r", "finish_by": 1e12, "source": "s"}),
        encode(Empty()),
        "bad_version",
    ),
    "no frame": (envelope(), None, "bad_frame"),
    "noise as frame": (envelope(), b"\x93" * 500, "bad_frame"),
    "another message": (envelope(), encode(examples.STATUS), "bad_frame"),
    "expired": (envelope(-1.0), encode(Empty()), "timeout"),
}


def test_garbage_is_answered_with_an_error_and_does_no_harm(zenoh_join: Join, cell_config: BusConfig) -> None:
    server = zenoh_join("server")
    served = []
    server.serve(endpoints.STATUS, lambda request, call: served.append(1) or examples.STATUS)
    server.announce()
    key = f"medor/{cell_config.cell}/robot/server/{server.boot}/status"
    with zenoh.open(client_config(cell_config)) as stranger:
        for name, (attachment, payload, code) in GARBAGE.items():
            replies = list(stranger.get(key, attachment=attachment, payload=payload, timeout=3))
            codes = [msgpack.unpackb(reply.err.payload.to_bytes())[0] for reply in replies if reply.err]
            assert codes == [code], name
        stranger.put(f"medor/{cell_config.cell}/health/robot/server", b"\xff" * 40)
        stranger.put(f"medor/{cell_config.cell}/robot/server/{server.boot}/@cancel", b"\xff" * 40)
        stranger.put(f"medor/{cell_config.cell}/action", b"\xff" * 40)
        stranger.liveliness().declare_token(f"medor/{cell_config.cell}/alive/robot/ghost/1")
        time.sleep(0.1)
    assert served == []
    asker = zenoh_join("asker")
    assert asker.ask(endpoints.STATUS, Empty()) == examples.STATUS


def test_a_reply_that_is_not_a_frame_is_an_error_of_its_own(zenoh_join: Join, cell_config: BusConfig) -> None:
    with zenoh.open(client_config(cell_config)) as stranger:
        base = f"medor/{cell_config.cell}"
        key = f"{base}/robot/odd/1/status"

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(key, b"\x00" * 7)

        queryable = stranger.declare_queryable(key, answer, complete=True)
        token = stranger.liveliness().declare_token(f"{base}/alive/robot/odd/1")
        asker = zenoh_join("asker")
        present(asker, "robot")
        with pytest.raises(MedorError) as raised:
            asker.ask(endpoints.STATUS, Empty())
        assert raised.value.code == "bad_frame"
        token.undeclare()
        queryable.undeclare()


# --- locked configuration -------------------------------------------------------------------------------------------


def test_a_client_listens_on_nothing_and_looks_for_nobody() -> None:
    config = client_config(BusConfig())
    for key, expected in {
        "mode": '"client"',
        "listen/endpoints": "[]",
        "scouting/multicast/enabled": "false",
        "scouting/gossip/enabled": "false",
        "transport/link/tx/lease": "2000",
    }.items():
        assert config.get_json(key) == expected


def test_cells_on_one_router_do_not_see_each_other(router: str) -> None:
    with (
        ZenohBus("one", BusConfig(router=router, cell="one")) as one,
        ZenohBus("two", BusConfig(router=router, cell="two")) as two,
    ):
        one.serve(endpoints.STATUS, lambda request, call: examples.STATUS)
        one.announce()
        one.ask(endpoints.STATUS, Empty())
        with pytest.raises(Unavailable):
            two.ask(endpoints.STATUS, Empty(), timeout_s=0.3)
