"""With certificates, a peer does what its name allows and nothing else; what is denied never arrives."""

import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh

from medor_wire import endpoints, examples
from medor_wire.bus import Call
from medor_wire.codec import encode
from medor_wire.config import BusConfig
from medor_wire.endpoints import Endpoint
from medor_wire.errors import Cancelled, Unavailable
from medor_wire.messages import ActOutcome, ActRequest, DepthView, EmergencyStop, Empty, Message
from medor_wire.zenoh_bus import ZenohBus
from medor_wire.zenoh_config import client_config, router_config
from tests.wire.conftest import free_port
from tests.wire.test_bus import eventually, in_thread

NAMES = ("router", "planner", "sim", "gateway", "recon", "viewer")


def openssl(*words: str, cwd: Path) -> None:
    subprocess.run(["openssl", *words], cwd=cwd, check=True, capture_output=True)


def authority(folder: Path) -> Path:
    folder.mkdir()
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", "ca.key")
    openssl("req", "-x509", *key, "-out", "ca.pem", "-subj", "/CN=authority", "-days", "2", cwd=folder)
    return folder


def certificate(authority: Path, name: str, folder: Path) -> Path:
    """A folder as `BusConfig.tls` expects it."""
    folder.mkdir()
    (folder / "ca.pem").write_bytes((authority / "ca.pem").read_bytes())
    (folder / "names").write_text("subjectAltName=DNS:localhost,IP:127.0.0.1\n")
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", "key.pem")
    openssl("req", *key, "-out", "request", "-subj", f"/CN={name}", cwd=folder)
    sign = ("-CA", str(authority / "ca.pem"), "-CAkey", str(authority / "ca.key"), "-CAcreateserial")
    openssl("x509", "-req", "-in", "request", *sign, "-out", "cert.pem", "-extfile", "names", "-days", "2", cwd=folder)
    return folder


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Certificates by name, all of one authority but `forged`."""
    root = tmp_path_factory.mktemp("pki")
    ours, theirs = authority(root / "ours"), authority(root / "theirs")
    made = {name: certificate(ours, name, root / name) for name in NAMES}
    return made | {"forged": certificate(theirs, "planner", root / "forged")}


@pytest.fixture(scope="module")
def address(folders: dict[str, Path]) -> Iterator[str]:
    address = f"tls/localhost:{free_port()}"
    with zenoh.open(router_config(address, tls=folders["router"])):
        yield address


@pytest.fixture
def config(address: str, folders: dict[str, Path]) -> Callable[[str], BusConfig]:
    return lambda name: BusConfig(router=address, tls=folders[name], cell="secure")


@pytest.fixture
def join(config: Callable[[str], BusConfig]) -> Iterator[Callable[[str], ZenohBus]]:
    with ExitStack() as members:
        yield lambda name: members.enter_context(ZenohBus(name, config(name), patience_s=0))


class Cell:
    """A simulated cell that notes what reaches it."""

    def __init__(self, bus: ZenohBus) -> None:
        self.seen: list[str] = []
        self.cancelled = threading.Event()
        served: list[Endpoint[Any, Any]] = [
            endpoints.STATUS,
            endpoints.LEASE,
            endpoints.ACT,
            endpoints.CLEAR_STOP,
            endpoints.SCORE,
        ]
        for endpoint in served:
            bus.serve(endpoint, self._handler(endpoint))
        bus.serve(endpoints.CAPTURE, self._hang)
        bus.subscribe(endpoints.STOP, lambda order: self.seen.append(f"stop {order.reason}"))
        bus.announce()

    def _handler(self, endpoint: Endpoint) -> Callable[[Any, Call], Any]:
        def handle(request: Message, call: Call) -> Message:
            self.seen.append(endpoint.name)
            return examples.EXCHANGES[endpoint].reply

        return handle

    def _hang(self, request: Empty, call: Call) -> DepthView:
        while not call.withdrawn():
            time.sleep(0.005)
        self.cancelled.set()
        raise Cancelled("as asked")


MATRIX = [
    ("planner", endpoints.ACT, True),
    ("planner", endpoints.LEASE, True),
    ("planner", endpoints.STATUS, True),
    ("planner", endpoints.CLEAR_STOP, False),
    ("gateway", endpoints.ACT, False),
    ("gateway", endpoints.LEASE, False),
    ("gateway", endpoints.CLEAR_STOP, True),
    ("gateway", endpoints.SCORE, True),
    ("recon", endpoints.ACT, False),
    ("recon", endpoints.STATUS, False),
    ("viewer", endpoints.ACT, False),
    ("viewer", endpoints.SCORE, False),
]


@pytest.mark.parametrize(("name", "endpoint", "allowed"), MATRIX, ids=lambda x: getattr(x, "name", x))
def test_a_peer_asks_only_what_its_name_allows(
    join: Callable[[str], ZenohBus], name: str, endpoint: Endpoint, allowed: bool
) -> None:
    cell, asker = Cell(join("sim")), join(name)
    eventually(lambda: asker.instances(endpoint.service))
    request, reply = examples.EXCHANGES[endpoint].request, examples.EXCHANGES[endpoint].reply
    if allowed:
        assert asker.ask(endpoint, request) == reply
        assert cell.seen == [endpoint.name]
    else:
        with pytest.raises(Unavailable):
            asker.ask(endpoint, request, timeout_s=2)
        assert cell.seen == []


def test_cancelling_works_behind_the_lock(join: Callable[[str], ZenohBus]) -> None:
    cell, planner, cancel = Cell(join("sim")), join("planner"), threading.Event()
    eventually(lambda: planner.instances("robot"))
    thread, _ = in_thread(lambda: planner.ask(endpoints.CAPTURE, Empty(), cancel=cancel))
    time.sleep(0.2)
    cancel.set()
    assert cell.cancelled.wait(2)
    thread.join(3)


def test_everyone_with_a_certificate_sees_health_and_streams(join: Callable[[str], ZenohBus]) -> None:
    sim, viewer = join("sim"), join("viewer")
    Cell(sim)
    seen: list[object] = []
    viewer.subscribe(endpoints.ACTION, seen.append)
    eventually(lambda: "robot/sim" in viewer.health())

    def heard() -> bool:
        sim.publish(endpoints.ACTION, examples.OUTCOME)
        time.sleep(0.02)
        return bool(seen)

    eventually(heard)


def test_a_viewer_publishes_nothing_and_the_gateway_stops_the_robot(join: Callable[[str], ZenohBus]) -> None:
    cell, viewer, gateway = Cell(join("sim")), join("viewer"), join("gateway")
    time.sleep(0.2)
    viewer.publish(endpoints.STOP, EmergencyStop(reason="mischief"))
    time.sleep(0.1)
    gateway.publish(endpoints.STOP, EmergencyStop(reason="hand in the cell"))
    eventually(lambda: cell.seen)
    assert cell.seen == ["stop hand in the cell"]


def test_nobody_answers_in_the_robots_name(join: Callable[[str], ZenohBus]) -> None:
    def fake(request: ActRequest, call: Call) -> ActOutcome:
        raise AssertionError("a viewer was asked to move the robot")

    viewer, planner = join("viewer"), join("planner")
    viewer.serve(endpoints.ACT, fake)
    viewer.announce()
    time.sleep(0.3)
    assert planner.instances("robot") == []


def test_wildcards_open_no_door(join: Callable[[str], ZenohBus], config: Callable[[str], BusConfig]) -> None:
    cell = Cell(join("sim"))
    with zenoh.open(client_config(config("viewer"))) as viewer:
        overheard: list[str] = []
        subscriber = viewer.declare_subscriber("**", lambda sample: overheard.append(str(sample.key_expr)))
        for key in ("medor/**", "medor/*/robot/*/*/act", "**"):
            request = encode(examples.EXCHANGES[endpoints.ACT].request)
            assert [reply for reply in viewer.get(key, payload=request, timeout=1) if reply.ok] == []
        order = encode(EmergencyStop(reason="mischief"))
        viewer.put("medor/*/safety/estop", order, allowed_destination=zenoh.Locality.REMOTE)
        time.sleep(0.2)
        subscriber.undeclare()
    assert cell.seen == []
    assert overheard == []


@pytest.mark.parametrize("name", ["forged", None])
def test_without_a_certificate_of_ours_nobody_gets_in(
    address: str, folders: dict[str, Path], tmp_path: Path, name: str | None
) -> None:
    if name is None:
        bare = BusConfig(router=address.replace("tls/", "tcp/"))
    else:
        (tmp_path / "ca.pem").write_bytes((folders["planner"] / "ca.pem").read_bytes())
        for part in ("cert.pem", "key.pem"):
            (tmp_path / part).write_bytes((folders[name] / part).read_bytes())
        bare = BusConfig(router=address, tls=tmp_path)
    with pytest.raises(Unavailable, match="no router"):
        ZenohBus("planner", bare, patience_s=0)


def test_no_command_is_larger_than_a_command() -> None:
    """Without certificates too: a robot never reads megabytes sent to `act`."""
    address = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(router_config(address)), ZenohBus("sim", BusConfig(router=address)) as sim:
        cell = Cell(sim)
        key = f"medor/lab/robot/sim/{sim.boot}/act"
        with zenoh.open(client_config(BusConfig(router=address))) as stranger:
            assert list(stranger.get(key, payload=bytes(17 << 10), timeout=1)) == []
            assert len(list(stranger.get(key, payload=bytes(15 << 10), timeout=1))) == 1
    assert cell.seen == []
