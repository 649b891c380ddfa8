"""Plans whose candidates a rough model has screened. Both models are told what to think of a candidate."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from medor_dynamics.roller import Roller
from medor_planner.sampling import Candidates
from medor_planner.screening import AT_LEAST, Screening
from medor_wire import endpoints
from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import PlanProgress, PlanRequest, RolloutRequest, Rollouts

ASKED = PlanRequest(category="tshirt", method="oracle-mesh", candidates=200, seed=5)
LEFT = 30
Opinion = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Picks and places (K, 3) -> rewards (K,)."""


def length(picks: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The longer the pull, the better; 0 for doing nothing."""
    return np.linalg.norm(places - picks, axis=1).astype(np.float64)


def shortness(picks: np.ndarray, places: np.ndarray) -> np.ndarray:
    return -length(picks, places)


@dataclass
class Opinionated:
    """A backend that knows what it thinks."""

    opinion: Opinion
    asked: list[int] = field(default_factory=list)

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts:
        self.asked.append(len(request.picks))
        positions = np.repeat(request.mesh.vertices[None], len(request.picks), axis=0)
        return Rollouts(positions=positions, rewards=self.opinion(request.picks, request.places), seconds=0)


@pytest.fixture
def think(lab) -> Callable[..., tuple[Opinionated, Opinionated]]:
    """Replaces the dynamics instances of the lab by some that think as they are told."""

    def make(learned: Opinion, screen: Opinion | None, replicas: int = 1) -> tuple[Opinionated, Opinionated]:
        lab.members["dynamics-1"].close()
        backends: dict[str, Opinionated] = dict.fromkeys(("learned", "physics"), Opinionated(learned))
        if screen is not None:
            backends["coarse"] = Opinionated(screen)
        for number in range(replicas):
            lab.join(f"thinking-{number}").serve(endpoints.ROLLOUT, Roller(backends).roll_out)
        return backends["learned"], backends.get("coarse", Opinionated(shortness))

    return make


def test_a_screen_that_thinks_like_the_model_changes_nothing(lab, think):
    think(length, length)
    screened = lab.bus.ask(endpoints.PLAN, ASKED)
    exhaustive = lab.bus.ask(endpoints.PLAN, ASKED.model_copy(update={"exhaustive": True}))
    np.testing.assert_array_equal(screened.top_picks, exhaustive.top_picks)
    np.testing.assert_array_equal(screened.top_rewards, exhaustive.top_rewards)
    assert (screened.candidates, screened.survivors) == (200, LEFT)
    assert (exhaustive.candidates, exhaustive.survivors) == (200, 200)


def test_the_model_is_asked_about_survivors_and_doing_nothing_only(lab, think):
    learned, screen = think(length, length)
    lab.bus.ask(endpoints.PLAN, ASKED)
    assert sum(screen.asked) == 200
    assert sum(learned.asked) == LEFT + 1
    lab.bus.ask(endpoints.PLAN, ASKED.model_copy(update={"exhaustive": True}))
    assert sum(screen.asked) == 200
    assert sum(learned.asked) == LEFT + 1 + 200 + 1


def test_the_screen_proposes_and_the_model_chooses(lab, think):
    """The screen leaves the shortest pulls; the model takes the longest of these and knows their rewards."""
    think(length, shortness)
    plan = lab.bus.ask(endpoints.PLAN, ASKED.model_copy(update={"report": 200}))
    every = lab.bus.ask(endpoints.PLAN, ASKED.model_copy(update={"report": 200, "exhaustive": True}))
    assert len(plan.top_rewards) == LEFT
    assert len(every.top_rewards) == 200
    np.testing.assert_array_equal(plan.top_rewards, every.top_rewards[-LEFT:])
    assert plan.reward == plan.top_rewards[0]


def test_doing_nothing_is_never_screened_out(lab, think):
    think(shortness, length)
    plan = lab.bus.ask(endpoints.PLAN, ASKED)
    assert plan.no_op
    assert plan.reward == plan.no_op_reward == 0


@pytest.mark.parametrize("replicas", [2, 3])
def test_the_plan_does_not_depend_on_the_number_of_replicas(lab, think, replicas):
    think(length, lambda picks, places: np.round(picks[:, 0], 2).astype(float))  # many ties
    one = lab.bus.ask(endpoints.PLAN, ASKED)
    lab.members["thinking-0"].close()
    lab.add_dynamics("dynamics-1")
    think(length, lambda picks, places: np.round(picks[:, 0], 2).astype(float), replicas)
    many = lab.bus.ask(endpoints.PLAN, ASKED)
    np.testing.assert_array_equal(one.top_picks, many.top_picks)
    np.testing.assert_array_equal(one.top_rewards, many.top_rewards)


def test_screening_is_told_and_timed_before_the_rollouts(lab, think):
    think(length, length)
    told: list[PlanProgress] = []
    plan = lab.bus.ask(endpoints.PLAN, ASKED, on_progress=told.append)
    stages = [progress.stage for progress in told]
    assert sorted(set(stages), key=stages.index)[-3:] == ["sample", "screen", "rollout"]
    assert {"screen", "rollout"} <= set(plan.timings_ms)


def test_where_the_screen_refuses_planning_is_exhaustive_and_says_so_once(lab, think, caplog):
    learned, _ = think(length, None)
    with caplog.at_level(logging.WARNING):
        plans = [lab.bus.ask(endpoints.PLAN, ASKED.model_copy(update={"seed": seed})) for seed in (1, 2)]
    assert [plan.survivors for plan in plans] == [200, 200]
    assert sum(learned.asked) == 2 * 201
    assert sum("without screening" in record.getMessage() for record in caplog.records) == 1


def test_the_cloth_solver_is_screened_like_any_model(lab, think):
    physics, screen = think(length, length)
    assert lab.bus.ask(endpoints.PLAN, ASKED.model_copy(update={"method": "oracle"})).survivors == LEFT
    assert (sum(screen.asked), sum(physics.asked)) == (200, LEFT + 1)


def drawn(count: int) -> Candidates:
    picks = np.random.default_rng(0).uniform(size=(count, 3)).astype(np.float32)
    return Candidates(picks, picks)


@pytest.mark.parametrize(("count", "left"), [(1000, 200), (101, 21), (60, AT_LEAST), (7, 7)])
def test_a_share_survives_but_never_fewer_than_a_plan_reports(count, left):
    assert Screening(keep=0.2).leaves(count) == left
    survivors = Screening(keep=0.2).survivors(drawn(count), lambda some, _: np.arange(len(some), dtype=float))
    np.testing.assert_array_equal(survivors.picks, drawn(count).picks[-left:])


def test_without_a_backend_all_survive():
    assert Screening("").leaves(500) == 500


def test_of_equal_candidates_the_first_survive():
    survivors = Screening(keep=0.5).survivors(drawn(100), lambda some, _: np.zeros(len(some)))
    np.testing.assert_array_equal(survivors.picks, drawn(100).picks[:50])


def test_other_failures_of_the_screen_are_the_plans():
    def lost(candidates: Candidates, backend: str) -> np.ndarray:
        raise RuntimeError("lost")

    with pytest.raises(RuntimeError):
        Screening().survivors(drawn(100), lost)

    def refuse(candidates: Candidates, backend: str) -> np.ndarray:
        raise BadRequest("no coarse mesh")

    assert len(Screening().survivors(drawn(100), refuse)) == 100
