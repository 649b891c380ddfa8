import json
import threading
import time

import httpx
import numpy as np

from medor_wire import errors

EPISODE = {"category": "tshirt", "max_picks": 3, "garment_seed": 3, "state": "drop"}


def start(door: httpx.Client, **changes) -> str:
    answer = door.post("/episodes", json={**EPISODE, **changes})
    assert answer.status_code == 202
    assert answer.headers["Location"] == f"/episodes/{answer.json()['id']}"
    return answer.headers["Location"]


def events(door: httpx.Client, path: str, after: int | None = None) -> list[tuple[int, str, dict]]:
    """All events until the stream ends."""
    found, fields = [], {}
    headers = {} if after is None else {"Last-Event-ID": str(after)}
    with door.stream("GET", f"{path}/events", headers=headers) as answer:
        if answer.status_code == 204:
            return []
        assert answer.headers["Content-Type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            name, _, value = line.partition(": ")
            if name:
                fields[name] = value
            elif fields:
                found.append((int(fields["id"]), fields["event"], json.loads(fields["data"])))
                fields = {}
    return found


def test_an_episode_reports_every_pick(door: httpx.Client, cell) -> None:
    path = start(door)
    told = events(door, path)
    state = door.get(path).json()
    assert (state["status"], state["reason"], state["error"]) == ("done", "max_picks", None)
    assert [pick["index"] for pick in state["picks"]] == [0, 1, 2, 3]
    assert np.diff([pick["coverage_m2"] for pick in state["picks"]]).min() > 0
    assert state["ni"] == state["picks"][-1]["ni"]
    assert [data for _, name, data in told if name == "pick"] == state["picks"]
    assert told[-1][1:] == ("end", {"status": "done", "code": None, "detail": None})
    assert cell.acts == 3


def test_an_episode_ends_when_solved(door: httpx.Client) -> None:
    path = start(door, max_picks=50)
    events(door, path)
    state = door.get(path).json()
    assert state["reason"] == "solved"
    assert state["ni"] > 0.95
    assert len(state["picks"]) < 10


def test_events_arrive_while_the_episode_runs_and_go_on_after_the_last_one_seen(door: httpx.Client, cell) -> None:
    cell.go.clear()
    path = start(door)
    threading.Timer(0.3, cell.go.set).start()
    told = events(door, path)
    assert [number for number, _, _ in told] == list(range(1, len(told) + 1))
    for after in (0, 2, len(told) - 1):
        assert events(door, path, after) == told[after:]
    assert events(door, path, after=len(told)) == []


def test_each_pick_keeps_what_was_seen_and_considered(door: httpx.Client, cell) -> None:
    path = start(door, max_picks=1)
    events(door, path)
    pick = door.get(path).json()["picks"][1]
    detail = door.get(pick["url"]).json()
    assert {name: detail[name] for name in pick} == pick
    assert np.allclose(detail["plan"]["action"]["pick"], detail["pick"])
    assert detail["observation"]["K"][0][0] > 0
    mesh = door.get(detail["plan"]["mesh"]["url"])
    assert (mesh.status_code, mesh.content[:4]) == (200, b"glTF")
    assert door.get(f"{path}/picks/0").json()["plan"] is None
    assert door.get(f"{path}/picks/2").json()["code"] == "not_found"


def test_a_cancelled_episode_stops_and_keeps_its_picks(door: httpx.Client, cell) -> None:
    cell.go.clear()
    path = start(door)
    while not door.get(path).json()["picks"]:
        time.sleep(0.01)
    assert door.delete(path).status_code == 202
    assert events(door, path)[-1][2]["status"] == "cancelled"
    state = door.get(path).json()
    assert (state["status"], len(state["picks"]), cell.acts) == ("cancelled", 1, 0)
    assert door.delete(path).json() == state


def test_a_failed_episode_says_why(door: httpx.Client, cell) -> None:
    cell.failure = errors.ReconstructionFailed("too few points")
    path = start(door)
    assert events(door, path)[-1][2] == {
        "status": "failed",
        "code": "reconstruction_failed",
        "detail": "too few points",
    }
    problem = door.get(path).json()["error"]
    assert (problem["code"], problem["status"], problem["detail"]) == ("reconstruction_failed", 422, "too few points")


def test_an_episode_without_garment_goes_on_from_what_lies_there(door: httpx.Client, cell, members) -> None:
    asked = []
    plain = cell.reset
    cell.reset = lambda request, call: asked.append(request) or plain(request, call)
    door.post("/episodes", json={"max_picks": 1})
    path = start(door, max_picks=1, state="picks", garment_seed=9, seed=4)
    events(door, path)
    assert sorted((request.garment_seed, request.state, request.seed) for request in asked) == [
        (1, "drop", 0),  # the small cell's own answer to `reset: None`
        (9, "picks", 4),
    ]


def test_episodes_are_listed_newest_first(door: httpx.Client) -> None:
    paths = [start(door, max_picks=1) for _ in range(3)]
    for path in paths:
        events(door, path)
    listed = [f"/episodes/{episode['id']}" for episode in door.get("/episodes").json()["episodes"]]
    assert listed == paths[::-1]
