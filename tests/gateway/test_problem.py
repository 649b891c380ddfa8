import httpx
import pytest

from medor_gateway.limits import SMALL
from medor_gateway.problem import MEDIA_TYPE, STATUS, problem_of, status_of
from medor_wire.errors import Busy, MedorError, Unavailable, every_error


@pytest.mark.parametrize("kind", every_error().values(), ids=every_error())
def test_every_error_has_a_status_of_its_kind(kind: type[MedorError]) -> None:
    found = problem_of(kind("what was expected and what came"))
    assert found.code == kind.code
    assert found.detail == "what was expected and what came"
    assert 400 <= found.status < 600
    assert not (found.retry and found.status in (400, 404, 422)), "a wrong request stays wrong"


def test_a_child_takes_the_status_of_its_nearest_ancestor() -> None:
    class Crowded(Busy):
        code = "crowded"

    assert status_of(Crowded("x")) == STATUS[Busy] != STATUS[Unavailable]


@pytest.mark.parametrize(
    ("method", "path", "status", "code"),
    [
        ("GET", "/nowhere", 404, "not_found"),
        ("PUT", "/plan", 405, "method_not_allowed"),
        ("POST", "/episodes/x/picks/1", 405, "method_not_allowed"),
        ("GET", "/episodes/x/picks/first", 422, "invalid_request"),
        ("GET", "/meshes/x.exe", 422, "invalid_request"),
    ],
)
def test_what_the_door_itself_refuses_is_a_problem_too(door: httpx.Client, method, path, status, code) -> None:
    answer = door.request(method, path)
    assert answer.headers["Content-Type"] == MEDIA_TYPE
    assert (answer.status_code, answer.json()["status"], answer.json()["code"]) == (status, status, code)


def test_method_not_allowed_names_all_that_are(door: httpx.Client) -> None:
    assert door.put("/episodes/x").headers["Allow"] == "DELETE, GET"
    assert door.put("/plans/x").headers["Allow"] == "DELETE, GET"


@pytest.mark.parametrize(
    ("body", "where"),
    [
        (b'{"category": "sock"}', ["body", "category"]),
        (b'{"category": "tshirt", "colour": "red"}', ["body", "colour"]),
        (b'{"category": "tshirt", "options": {"candidates": "30"}}', ["body", "options", "candidates"]),
        (b'{"category": "tshirt", "options": {"seed": -1}}', ["body", "options", "seed"]),
        (b'{"category": "tshirt", "observation": {"depth_png": NaN}}', ["body", "observation", "depth_png"]),
    ],
)
def test_a_request_that_does_not_fit_says_where(door: httpx.Client, body: bytes, where: list[str], cell) -> None:
    answer = door.post("/plan", content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert where in [error["where"] for error in answer.json()["errors"]]
    assert not cell.asked


def test_text_that_is_no_unicode_is_refused_and_not_echoed_broken(door: httpx.Client) -> None:
    answer = door.post(
        "/estop/clear", content=b'{"operator": "\\ud800", "\\ud801": 1}', headers={"Content-Type": "application/json"}
    )
    assert answer.status_code == 422
    assert answer.json()["errors"]


@pytest.mark.parametrize("body", [b"{", b"\xff\xfe", b"[" * 100_000])
def test_a_body_that_is_no_json_is_the_askers_fault(door: httpx.Client, body: bytes) -> None:
    answer = door.post("/plan", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code in (400, 422)
    assert answer.headers["Content-Type"] == MEDIA_TYPE


@pytest.mark.parametrize("announced", [True, False])
def test_a_body_that_is_too_large_is_refused(door: httpx.Client, announced: bool) -> None:
    body = b" " * (SMALL + 1)
    chunks = body if announced else (body[i : i + 65536] for i in range(0, len(body), 65536))
    answer = door.post("/cell/reset", content=chunks, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["code"]) == (413, "too_large")
