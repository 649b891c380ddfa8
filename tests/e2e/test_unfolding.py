"""The main job on real input: a crumpled garment, its depth image, the chosen pick-and-place, more coverage."""

import httpx
import pytest

from medor_wire import endpoints
from medor_wire.launcher import Launcher
from medor_wire.messages import DEFAULT_METHOD, Empty

GARMENT = {"category": "tshirt", "garment_seed": 800001, "state": "drop", "seed": 1}


def plan(door: httpx.Client, method: str, candidates: int = 16) -> dict:
    """A plan for what lies on the table."""
    options = {"candidates": candidates, "seed": 3}
    answer = door.post("/plan", json={"category": GARMENT["category"], "method": method, "options": options})
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_everything_is_ready(door: httpx.Client) -> None:
    answer = door.get("/readyz")
    assert answer.status_code == 200
    assert [len(health["instances"]) for health in answer.json()["services"].values()] == [1, 2, 1, 1]


def test_foreseeing_with_the_true_mesh_and_acting_once_grows_the_coverage(cell: Launcher, door: httpx.Client) -> None:
    before = door.post("/cell/reset", json=GARMENT).json()["coverage_m2"]
    chosen = plan(door, "oracle")
    predicted = chosen["predicted"]
    assert predicted["no_op_reward"] == pytest.approx(before, rel=0.05)
    assert predicted["reward"] > 1.05 * before

    outcome = door.post(f"/plans/{chosen['plan_id']}/execute").json()
    after = cell.bus.ask(endpoints.SCORE, Empty()).coverage_m2
    assert outcome["grasped"]
    assert after == pytest.approx(predicted["reward"], rel=0.1)
    assert after > before

    again = door.post(f"/plans/{chosen['plan_id']}/execute").json()
    assert again["replayed"]
    assert again["action_id"] == outcome["action_id"]
    assert cell.bus.ask(endpoints.SCORE, Empty()).coverage_m2 == after, "the second call moved the cloth"


def test_a_depth_image_alone_is_enough(door: httpx.Client) -> None:
    door.post("/cell/reset", json=GARMENT).raise_for_status()
    seen = door.get("/cell/observation", headers={"Accept": "application/json"}).json()
    given = {"category": GARMENT["category"], "method": DEFAULT_METHOD, "observation": seen}
    plans = (
        door.post("/plan", json={**given, "options": {"candidates": 60, "seed": seed}}).json() for seed in range(4)
    )
    chosen = next((made for made in plans if made["action"]), None)
    assert chosen is not None, "none of 240 pick-and-places is better than doing nothing"
    assert chosen["timings_ms"]["capture"] < 1, "the cell's camera was asked although a view was given"
    assert chosen["predicted"]["reward"] > chosen["predicted"]["no_op_reward"]
    seen_again = plan(door, DEFAULT_METHOD, candidates=1)["predicted"]["no_op_reward"]
    assert chosen["predicted"]["no_op_reward"] == pytest.approx(seen_again, rel=0.05)
    assert door.post(f"/plans/{chosen['plan_id']}/execute").json()["grasped"]
