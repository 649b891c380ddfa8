import time

import httpx
import pytest
import structlog

from medor_wire import endpoints, logs
from medor_wire.errors import BadRequest


def readiness(door: httpx.Client, wanted: int, within_s: float) -> httpx.Response:
    """The answer of /readyz once it has this status."""
    deadline = time.monotonic() + within_s
    while (answer := door.get("/readyz")).status_code != wanted:
        assert time.monotonic() < deadline, f"not {wanted} within {within_s} s: {answer.text}"
        time.sleep(0.02)
    return answer


def test_ready_when_every_service_is(door: httpx.Client) -> None:
    ready = readiness(door, 200, within_s=2).json()
    assert set(ready["services"]) == {"recon", "dynamics", "planner", "robot"}
    assert all(service["ready"] for service in ready["services"].values())


@pytest.mark.parametrize("name", ["recon", "dynamics", "planner", "sim"])
def test_a_service_that_is_gone_is_told_at_once(door: httpx.Client, members, name: str) -> None:
    readiness(door, 200, within_s=2)
    getattr(members, name).close()
    ready = readiness(door, 503, within_s=0.5).json()
    missing = {service for service, health in ready["services"].items() if not health["ready"]}
    assert missing == {{"sim": "robot"}.get(name, name)}


def test_a_service_that_is_present_but_silent_is_told_within_three_seconds(
    door: httpx.Client, members, monkeypatch: pytest.MonkeyPatch
) -> None:
    readiness(door, 200, within_s=2)
    monkeypatch.setattr(members.recon, "_beat", lambda: None)
    recon = readiness(door, 503, within_s=3).json()["services"]["recon"]
    assert not recon["ready"]
    assert "silent" in recon["instances"][0]["detail"]


def test_a_service_that_warms_up_is_not_ready_and_says_why(door: httpx.Client, members) -> None:
    readiness(door, 200, within_s=2)
    members.recon.ready(False, "loading weights")
    recon = readiness(door, 503, within_s=2).json()["services"]["recon"]
    assert recon["instances"][0]["detail"] == "loading weights"


def test_one_ready_replica_is_enough(door: httpx.Client, bus, members) -> None:
    second = bus.connect("dynamics-2")
    second.serve(endpoints.FLATTEN, lambda request, call: request)
    second.ready()
    members.dynamics.close()
    ready = readiness(door, 200, within_s=2).json()
    assert [instance["id"] for instance in ready["services"]["dynamics"]["instances"]] == ["dynamics-2"]
    second.close()


def test_the_process_is_alive_whatever_the_services_are(door: httpx.Client, members) -> None:
    members.close()
    assert door.get("/healthz").json()["status"] == "ok"


def test_metrics_count_by_operation_and_not_by_id(door: httpx.Client) -> None:
    for number in range(3):
        door.get(f"/plans/{number}")
    door.get("/no/such/page")
    text = door.get("/metrics").text
    assert 'medor_http_requests_total{method="GET",route="/plans/{plan_id}",status="404"} 3.0' in text
    assert 'route="unmatched",status="404"} 1.0' in text
    assert "/plans/1" not in text


def test_the_page_needs_nothing_from_elsewhere(door: httpx.Client) -> None:
    page = door.get("/")
    assert page.headers["Content-Type"].startswith("text/html")
    assert "default-src 'none'" in page.headers["Content-Security-Policy"]
    assert "http://" not in page.text.replace("http://www.w3.org/2000/svg", "")
    assert "https://" not in page.text


def test_a_defect_shows_its_traceback_to_the_log_only_and_keys_to_nobody(
    door: httpx.Client, bus, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(service: str) -> list:
        raise ZeroDivisionError("a secret")

    logs.configure("json")
    monkeypatch.setattr(bus, "instances", broken)
    answer = door.get("/readyz", headers={"X-API-Key": "key-of-the-user"})
    log = capsys.readouterr().err
    structlog.reset_defaults()
    assert (answer.status_code, answer.json()["code"]) == (500, "internal")
    assert "secret" not in answer.text
    assert "a secret" in log
    assert answer.json()["request_id"] in log
    assert "key-of-the-user" not in log


def test_refusals_of_the_bus_are_answered_as_themselves(door: httpx.Client, bus, monkeypatch) -> None:
    def refuse(*args: object, **kwargs: object) -> None:
        raise BadRequest("not like this")

    monkeypatch.setattr(bus, "ask", refuse)
    assert door.get("/cell/status").json()["detail"] == "not like this"
