import threading
import time

import httpx
import numpy as np
import pytest

from medor_wire import errors

PLAN = {"category": "tshirt", "options": {"candidates": 30, "seed": 5}}


def ended(door: httpx.Client, path: str) -> dict:
    """The job behind `path` once it runs no more."""
    for _ in range(500):
        if (state := door.get(path).json())["status"] != "running":
            return state
        time.sleep(0.01)
    raise AssertionError(f"{path} still runs")


def test_a_plan_says_what_to_do_and_what_it_will_give(door: httpx.Client) -> None:
    plan = door.post("/plan", json=PLAN).raise_for_status().json()
    assert plan["predicted"]["reward"] > plan["predicted"]["no_op_reward"]
    assert np.allclose(np.array(plan["action"]["place"]), 1.2 * np.array(plan["action"]["pick"]), atol=1e-6)
    rewards = [candidate["reward"] for candidate in plan["candidates"]]
    assert len(rewards) == 20
    assert rewards == sorted(rewards, reverse=True)
    assert plan["mesh"]["vertices"] == 4
    assert plan["evaluated"] == 30


def test_no_action_when_doing_nothing_is_best(door: httpx.Client) -> None:
    door.post("/cell/reset", json={"state": "flat"}).raise_for_status()
    assert door.post("/plan", json=PLAN).json()["action"] is None


def test_what_the_camera_saw_can_be_sent_back_as_observation(door: httpx.Client, cell) -> None:
    seen = door.get("/cell/observation").json()
    door.post("/plan", json={**PLAN, "observation": seen}).raise_for_status()
    view = cell.asked[-1].view
    truth = cell.capture(None, None)
    assert np.abs(view.depth - truth.depth).max() <= 0.5e-4 + 1e-7
    assert (view.mask == truth.mask).all()
    assert (view.camera.K == truth.camera.K).all()
    assert (view.camera.T_world_camera == truth.camera.T_world_camera).all()
    assert abs(view.stamp_ns - truth.stamp_ns) < 1000


@pytest.mark.parametrize("method", ["medor+judge", "medor+physics", "no-finetuning", "visible"])
def test_every_kind_of_method_name_reaches_the_planner(door: httpx.Client, cell, method: str) -> None:
    door.post("/plan", json={**PLAN, "method": method}).raise_for_status()
    assert cell.asked[-1].method == method


def test_executing_twice_moves_once(door: httpx.Client, cell) -> None:
    plan_id = door.post("/plan", json=PLAN).json()["plan_id"]
    first, again = (door.post(f"/plans/{plan_id}/execute").json() for _ in range(2))
    assert not first["replayed"]
    assert again == {**first, "replayed": True}
    assert cell.acts == 1


def test_a_plan_made_before_the_door_opened_can_be_executed(door: httpx.Client, cell) -> None:
    cell.plans["of-yesterday"] = None
    assert door.post("/plans/of-yesterday/execute").json()["grasped"]


def test_an_unknown_plan_is_not_found(door: httpx.Client) -> None:
    for answer in (door.post("/plans/none/execute"), door.get("/plans/none"), door.delete("/plans/none")):
        assert answer.status_code == 404
        assert answer.json()["code"] == "not_found"


def test_an_asynchronous_plan_is_found_at_its_location(door: httpx.Client, cell) -> None:
    cell.go.clear()
    answer = door.post("/plan", json=PLAN, headers={"Prefer": "respond-async"})
    assert answer.status_code == 202
    assert door.get(answer.headers["Location"]).json()["status"] == "running"
    refused = door.post(f"{answer.headers['Location']}/execute")
    assert (refused.status_code, refused.json()["code"]) == (409, "refused")
    cell.go.set()
    state = ended(door, answer.headers["Location"])
    assert state["status"] == "done"
    assert state["progress"] == {"stage": "rollout", "fraction": 0.5}
    assert door.get(f"/plans/{state['plan']['plan_id']}").json() == state
    assert door.post(f"{answer.headers['Location']}/execute").json()["action_id"] == state["plan"]["plan_id"]


def test_a_cancelled_plan_stops_in_the_planner(door: httpx.Client, cell) -> None:
    cell.go.clear()
    path = door.post("/plan", json=PLAN, headers={"Prefer": "respond-async"}).headers["Location"]
    assert door.delete(path).status_code == 202
    state = ended(door, path)
    assert (state["status"], state["error"]["code"]) == ("cancelled", "cancelled")


@pytest.mark.parametrize(
    ("failure", "status"),
    [
        (errors.NoGarment("nothing but table"), 422),
        (errors.Unavailable("nobody serves dynamics"), 503),
        (errors.Busy("queue full"), 429),
        (errors.OutcomeUnknown("look again"), 409),
    ],
)
def test_the_planners_refusal_becomes_a_problem(door: httpx.Client, cell, failure, status: int) -> None:
    cell.failure = failure
    answer = door.post("/plan", json=PLAN)
    assert answer.status_code == status
    assert answer.headers["Content-Type"] == "application/problem+json"
    problem = answer.json()
    assert (problem["code"], problem["detail"]) == (failure.code, str(failure))
    assert problem["request_id"] == answer.headers["X-Request-Id"]
    assert problem["retry"] == ("Retry-After" in answer.headers) == failure.retry


def test_without_a_planner_the_answer_is_503_at_once(door: httpx.Client, members) -> None:
    members.planner.close()
    started = time.monotonic()
    answer = door.post("/plan", json=PLAN)
    assert time.monotonic() - started < 2
    assert (answer.status_code, answer.json()["code"]) == (503, "unavailable")


def test_a_planner_that_dies_while_planning_is_noticed(door: httpx.Client, members, cell) -> None:
    cell.go.clear()
    threading.Timer(0.2, members.planner.close).start()
    started = time.monotonic()
    assert door.post("/plan", json=PLAN).status_code in (409, 503)
    assert time.monotonic() - started < 5


def test_more_plans_than_allowed_are_turned_away(door: httpx.Client, cell, config) -> None:
    cell.go.clear()
    ask = {"url": "/plan", "json": PLAN, "headers": {"Prefer": "respond-async"}}
    paths = [door.post(**ask).headers["Location"] for _ in range(config.plans_at_once)]
    answer = door.post(**ask)
    assert (answer.status_code, answer.json()["code"]) == (429, "busy")
    assert int(answer.headers["Retry-After"]) >= 1
    cell.go.set()
    for path in paths:
        assert ended(door, path)["status"] == "done"
    assert door.post(**ask).status_code == 202
