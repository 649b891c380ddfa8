import itertools

import httpx
import pytest

from medor_gateway.app import create_app
from medor_gateway.auth import Keyring, is_loopback
from medor_gateway.config import Config
from medor_gateway.serve import main

READER, MOVER = "reader-0123456789", "mover-0123456789a"
KEYS = f"{READER}=read, {MOVER}=read+plan+robot:move"


@pytest.fixture
def config() -> Config:
    return Config(keys=KEYS)


@pytest.mark.parametrize("header", ["Authorization", "X-API-Key"])
def test_a_known_key_enters_by_either_header(door: httpx.Client, header: str) -> None:
    value = f"Bearer {READER}" if header == "Authorization" else READER
    assert door.get("/cell/status", headers={header: value}).status_code == 200


@pytest.mark.parametrize("headers", [{}, {"X-API-Key": "x" * 17}, {"Authorization": "Basic abc"}])
def test_without_a_known_key_nothing_opens(door: httpx.Client, headers: dict[str, str]) -> None:
    for method, path in (("GET", "/cell/status"), ("POST", "/estop"), ("POST", "/plan"), ("GET", "/metrics")):
        answer = door.request(method, path, headers=headers, json={"category": "tshirt"} if path == "/plan" else None)
        assert (answer.status_code, answer.json()["code"]) == (401, "unauthorized")
        assert answer.headers["WWW-Authenticate"] == "Bearer"


def test_reading_does_not_allow_moving(door: httpx.Client, cell) -> None:
    moves = ("/cell/reset", {}), ("/plan", {"category": "tshirt"}), ("/plans/x/execute", None), ("/episodes", {})
    for path, body in moves:
        answer = door.post(path, json=body, headers={"X-API-Key": READER})
        assert (answer.status_code, answer.json()["code"]) == (403, "forbidden")
    assert not cell.asked
    assert not cell.acts
    assert door.post("/cell/reset", json={}, headers={"X-API-Key": MOVER}).status_code == 200


def test_anyone_with_a_key_may_stop_but_not_clear(door: httpx.Client) -> None:
    assert door.post("/estop", headers={"X-API-Key": READER}).status_code == 202
    assert door.post("/estop/clear", json={"operator": "eve"}, headers={"X-API-Key": READER}).status_code == 403


def test_probes_need_no_key(door: httpx.Client) -> None:
    assert door.get("/healthz").status_code == 200
    assert door.get("/readyz").status_code in (200, 503)


def test_every_operation_but_the_probes_asks_for_a_key(bus, config: Config) -> None:
    paths = create_app(bus, config).openapi()["paths"]
    open_ones = {path for path, operations in paths.items() for o in operations.values() if "security" not in o}
    assert open_ones == {"/healthz", "/readyz"}
    assert not any("security" in o for p in create_app(bus, Config()).openapi()["paths"].values() for o in p.values())


@pytest.mark.parametrize("text", ["short=read", f"{READER}=everything", READER, f"{READER}="])
def test_keys_that_protect_nothing_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="API key 1"):
        Keyring.parse(text)


def test_keys_are_not_kept_in_the_clear() -> None:
    assert READER not in repr(Keyring.parse(KEYS))


@pytest.mark.parametrize("host", ["0.0.0.0", "10.0.0.5", "example.org", "::"])
def test_the_service_refuses_to_listen_elsewhere_without_keys(host: str) -> None:
    assert not is_loopback(host)
    with pytest.raises(SystemExit, match="without API keys"):
        main(Config(host=host))


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.8.8", "::1", "[::1]", "localhost"])
def test_loopback_is_known_in_all_its_spellings(host: str) -> None:
    assert is_loopback(host)


class TestOpenDoor:
    """Without keys, on loopback."""

    @pytest.fixture
    def config(self) -> Config:
        return Config()

    def test_this_machine_may_do_everything(self, door: httpx.Client) -> None:
        assert door.post("/cell/reset", json={}).status_code == 200

    def test_its_own_page_may_too(self, door: httpx.Client) -> None:
        own = {"Origin": str(door.base_url).rstrip("/")}
        assert door.post("/cell/reset", json={}, headers=own).status_code == 200

    def test_foreign_pages_and_rebound_names_may_not(self, door: httpx.Client, cell) -> None:
        forged = itertools.product(
            [{"Origin": "https://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"}, {"Host": "[:"}],
            ["/cell/reset", "/episodes"],
        )
        for headers, path in forged:
            answer = door.post(path, json={}, headers=headers)
            assert (answer.status_code, answer.json()["code"]) == (403, "forbidden")
