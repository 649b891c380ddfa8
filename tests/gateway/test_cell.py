import io
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import httpx
import numpy as np
import pytest
from PIL import Image

POOL = 40
"""Threads that answer ordinary calls (AnyIO's default)."""


def test_reset_answers_the_score_of_the_start(door: httpx.Client) -> None:
    crumpled = door.post("/cell/reset", json={"category": "tshirt", "garment_seed": 3, "state": "drop"}).json()
    flat = door.post("/cell/reset", json={"category": "tshirt", "garment_seed": 3, "state": "flat"}).json()
    assert crumpled["ni_flatten"] == pytest.approx(0)
    assert flat["coverage_m2"] == flat["flat_coverage_m2"] > crumpled["coverage_m2"]


def test_an_uploaded_garment_can_be_put_on_the_table(door: httpx.Client) -> None:
    mesh = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    answer = door.post("/cell/garment", params={"category": "skirt", "file_type": "obj"}, content=mesh)
    assert answer.status_code == 201
    garment_id = answer.json()["garment_id"]
    assert door.post("/cell/reset", json={"category": "skirt", "garment_id": garment_id}).status_code == 200
    assert door.post("/cell/reset", json={"garment_id": "another"}).json()["code"] == "not_found"


def test_a_mesh_that_is_none_is_refused_with_the_simulators_words(door: httpx.Client) -> None:
    answer = door.post("/cell/garment", params={"category": "skirt", "file_type": "obj"}, content=b"hello")
    assert (answer.status_code, answer.json()["detail"]) == (400, "expected a mesh, got no vertices")


@pytest.mark.parametrize("accept", ["image/png", "image/avif,image/webp,image/*,*/*;q=0.8"])
def test_the_observation_is_a_picture_for_those_who_want_one(door: httpx.Client, accept: str) -> None:
    answer = door.get("/cell/observation", headers={"Accept": accept})
    assert answer.headers["Content-Type"] == "image/png"
    pixels = np.asarray(Image.open(io.BytesIO(answer.content)))
    assert pixels.shape == (24, 24, 3)
    assert (pixels[12, 12] != pixels[0, 0]).any(), "cloth and table look alike"


def test_a_stop_is_latched_until_an_operator_clears_it(door: httpx.Client, cell) -> None:
    plan_id = door.post("/plan", json={"category": "tshirt"}).json()["plan_id"]
    assert door.post("/estop", json={"reason": "a hand"}).status_code == 202
    for _ in range(100):
        if (state := door.get("/cell/status").json()["state"]) == "stopped":
            break
        time.sleep(0.01)
    assert state == "stopped"
    refused = door.post(f"/plans/{plan_id}/execute")
    assert (refused.status_code, refused.json()["code"]) == (409, "emergency_stopped")
    assert door.post("/estop/clear", json={}).status_code == 422
    assert door.post("/estop/clear", json={"operator": "ada"}).json()["state"] == "idle"
    assert door.post(f"/plans/{plan_id}/execute").json()["grasped"]


def test_a_stop_needs_no_body_and_no_free_thread(door: httpx.Client, bus, cell, monkeypatch) -> None:
    go, asking, ask = threading.Event(), threading.Semaphore(0), bus.ask

    def slow(*args: object, **kwargs: object) -> object:
        asking.release()
        go.wait(10)
        return ask(*args, **kwargs)

    monkeypatch.setattr(bus, "ask", slow)
    limits = httpx.Limits(max_connections=100)
    with httpx.Client(base_url=door.base_url, limits=limits, timeout=20) as crowd, ThreadPoolExecutor(60) as pool:
        answers = [pool.submit(crowd.get, "/cell/status") for _ in range(60)]
        for _ in range(POOL):
            assert asking.acquire(timeout=10)
        started = time.monotonic()
        assert door.post("/estop").status_code == 202
        assert door.get("/healthz").status_code == 200
        took = time.monotonic() - started
        go.set()
        assert {answer.result().status_code for answer in answers} <= {200, 429}
    assert took < 1
    assert cell.stopped


def test_without_a_robot_the_answer_is_503(door: httpx.Client, members) -> None:
    members.sim.close()
    answer = door.get("/cell/status")
    assert (answer.status_code, answer.json()["code"]) == (503, "unavailable")
