"""The door keeps the promises of its OpenAPI document, whatever is sent: every check of Schemathesis."""

from collections.abc import Iterator

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis import AuthContext, Case, Response
from schemathesis.core import NOT_SET, NotSet

from medor_gateway.app import create_app
from medor_gateway.config import Config
from medor_wire.local_bus import LocalBus

KEY = "everything-0123456789"
BUS = LocalBus("gateway")
APP = create_app(BUS, Config(keys=f"{KEY}=read+plan+robot:move", plans_at_once=1000, episodes_at_once=1000))
SCHEMA = schemathesis.openapi.from_asgi("/openapi.json", APP)
# What the document allows is never "invalid" (422). It may still hold a picture that is none: 400.
SCHEMA.config.checks.positive_data_acceptance.expected_statuses += ["400"]


@SCHEMA.auth()
class Key:
    """Enters with the key, where Schemathesis does not try to do without."""

    def get(self, case: Case, context: AuthContext) -> str:
        return KEY

    def set(self, case: Case, data: str, context: AuthContext) -> None:
        case.headers["Authorization"] = f"Bearer {data}"


@pytest.fixture(autouse=True, scope="module")
def _cell(small_cell) -> Iterator[None]:
    with small_cell(BUS):
        yield
    BUS.close()


@SCHEMA.parametrize()
@settings(max_examples=5, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.filter_too_much])
def test_every_operation_keeps_its_promises(case: Case) -> None:
    case.call_and_validate()


def test_what_exists_is_answered_as_promised_too() -> None:
    """Generated ids are never those of things that exist; here they are."""
    plan = ask("/plan", "POST", body={"category": "tshirt"}).json()
    ask("/plans/{plan_id}", "GET", plan_id=plan["plan_id"])
    ask("/plans/{plan_id}/execute", "POST", plan_id=plan["plan_id"])
    for file_type in ("glb", "ply"):
        ask("/meshes/{mesh_id}.{file_type}", "GET", mesh_id=plan["plan_id"], file_type=file_type)
    episode = ask("/episodes", "POST", body={"max_picks": 1, "state": "drop"}).json()
    ask("/episodes/{episode_id}/events", "GET", episode_id=episode["id"])
    ask("/episodes/{episode_id}", "GET", episode_id=episode["id"])
    for index in (0, 1):
        ask("/episodes/{episode_id}/picks/{index}", "GET", episode_id=episode["id"], index=index)
    ask("/episodes/{episode_id}", "DELETE", episode_id=episode["id"])


def ask(path: str, method: str, body: dict | NotSet = NOT_SET, **parameters: str | int) -> Response:
    """The answer to one request, 2xx and checked against the document."""
    media_type = None if isinstance(body, NotSet) else "application/json"
    case = SCHEMA[path][method].Case(path_parameters=parameters, body=body, media_type=media_type)
    response = case.call_and_validate(headers={"Authorization": f"Bearer {KEY}"})
    assert response.status_code // 100 == 2, response.text
    return response
