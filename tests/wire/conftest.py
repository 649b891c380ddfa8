"""A network for the tests: in process, or over Zenoh with the router hosted here."""

import socket
import uuid
from collections.abc import Callable, Iterator

import pytest
import zenoh

from medor_wire.config import BusConfig
from medor_wire.local_bus import LocalBus
from medor_wire.member import Member
from medor_wire.zenoh_bus import ZenohBus
from medor_wire.zenoh_config import router_config


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="session")
def router() -> Iterator[str]:
    """Address of a router that lives as long as the tests."""
    address = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(router_config(address)):
        yield address


@pytest.fixture
def cell_config(router: str) -> BusConfig:
    """A cell of the test's own."""
    return BusConfig(router=router, cell=f"test-{uuid.uuid4().hex[:8]}")


@pytest.fixture
def zenoh_join(cell_config: BusConfig) -> Iterator[Callable[[str], Member]]:
    """Makes members of one Zenoh bus."""
    members: list[Member] = []

    def join(id: str) -> Member:
        members.append(ZenohBus(id, cell_config))
        return members[-1]

    yield join
    for member in members:
        member.close()


@pytest.fixture
def local_join() -> Iterator[Callable[[str], Member]]:
    """Makes members of one bus inside this process."""
    first = LocalBus("first")
    members: list[Member] = [first]

    def join(id: str) -> Member:
        members.append(first.connect(id))
        return members[-1]

    yield join
    for member in members:
        member.close()


@pytest.fixture(params=["local", "zenoh"])
def join(request: pytest.FixtureRequest) -> Callable[[str], Member]:
    """Makes members of one bus, once for every kind of bus."""
    return request.getfixturevalue(f"{request.param}_join")
