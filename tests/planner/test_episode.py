import threading

import numpy as np
import pytest

from medor_wire import endpoints
from medor_wire.errors import BadRequest, Cancelled, LeaseHeld, NotFound, Unavailable
from medor_wire.messages import (
    Episode,
    EpisodeProgress,
    EpisodeRequest,
    ExecuteRequest,
    LeaseRequest,
    PlanRequest,
    ResetRequest,
)

FLATTEN = EpisodeRequest(method="oracle", max_picks=2, candidates=6, seed=3, reset=ResetRequest())
PLAN = PlanRequest(category="tshirt", method="oracle", candidates=8)


def actions(episode: Episode) -> list[tuple]:
    return [(str(pick.pick), str(pick.place), pick.reward, pick.ni) for pick in episode.picks[1:]]


def test_an_episode_improves_and_says_how(lab):
    told: list[EpisodeProgress] = []
    episode = lab.bus.ask(endpoints.EPISODE, FLATTEN, on_progress=told.append)
    steps = [progress.step for progress in told if progress.step is not None]
    assert episode.ni > 0.2
    assert [pick.index for pick in episode.picks] == list(range(len(episode.picks)))
    assert [step.index for step in steps] == [pick.index for pick in episode.picks]
    assert all(step.view is not None and step.plan is not None for step in steps[1:])
    assert all(pick.view is None and pick.plan is None for pick in episode.picks)
    assert any(progress.planning is not None for progress in told)
    assert episode.ni == episode.picks[-1].ni
    assert lab.cell.lessor.holder is None


def test_the_same_seed_gives_the_same_episode_pick_for_pick(lab):
    one = lab.bus.ask(endpoints.EPISODE, FLATTEN)
    lab.add_dynamics("dynamics-2")
    two = lab.bus.ask(endpoints.EPISODE, FLATTEN)
    assert actions(one) == actions(two)
    assert len(one.picks) > 1


def test_an_episode_is_executed_by_who_it_asks_for(lab):
    panda = FLATTEN.model_copy(update={"executor": "panda", "max_picks": 1})
    assert len(lab.bus.ask(endpoints.EPISODE, panda).picks) == 2
    assert lab.cell.executors == lab.cell.asked_reach_of == ["panda"]


def test_every_pick_draws_other_candidates(lab):
    lab.cell.lay(lab.cell.flat)
    flat = FLATTEN.model_copy(update={"reset": None, "max_picks": 2, "candidates": 4, "stop_ni": 1e12})
    plans = []
    lab.bus.ask(endpoints.EPISODE, flat, on_progress=lambda p: plans.append(p.step.plan) if p.step else None)
    assert (plans[1].top_picks != plans[2].top_picks).any()


def test_a_no_op_spends_a_pick_and_moves_nothing(lab):
    lab.cell.lay(lab.cell.flat)
    before = lab.cell.positions.copy()
    flat = FLATTEN.model_copy(update={"reset": None, "max_picks": 2, "candidates": 3, "stop_ni": 1e12})
    episode = lab.bus.ask(endpoints.EPISODE, flat)
    assert [pick.no_op for pick in episode.picks[1:]] == [True, True]
    assert episode.reason == "max_picks"
    assert not lab.cell.acts
    np.testing.assert_array_equal(lab.cell.positions, before)


def test_an_episode_ends_when_the_garment_is_done(lab):
    episode = lab.bus.ask(endpoints.EPISODE, FLATTEN.model_copy(update={"stop_ni": 0.05, "max_picks": 10}))
    assert episode.reason == "solved"
    assert episode.picks[-1].ni > 0.05 >= episode.picks[-2].ni


def test_cancel_stops_before_the_next_action_and_lets_go_of_the_robot(lab):
    cancel = threading.Event()

    def cancel_at_the_second(progress: EpisodeProgress) -> None:
        if progress.step is not None and progress.step.index == 1:
            cancel.set()

    endless = FLATTEN.model_copy(update={"max_picks": 100, "stop_ni": 1e12})
    with pytest.raises(Cancelled):
        lab.bus.ask(endpoints.EPISODE, endless, on_progress=cancel_at_the_second, cancel=cancel)
    assert len(lab.cell.acts) <= 1
    assert lab.cell.lessor.holder is None


def test_the_robot_is_held_for_the_whole_episode(lab):
    refused: list[Exception] = []
    plan = lab.bus.ask(endpoints.PLAN, PLAN)

    def meddle(progress: EpisodeProgress) -> None:
        if progress.step is not None and not refused:
            try:
                lab.bus.ask(endpoints.EXECUTE, ExecuteRequest(plan_id=plan.plan_id))
            except LeaseHeld as error:
                refused.append(error)

    lab.bus.ask(endpoints.EPISODE, FLATTEN.model_copy(update={"max_picks": 1}), on_progress=meddle)
    assert len(refused) == 1
    assert plan.plan_id not in lab.cell.acts


def test_the_lease_is_renewed_while_it_is_held(lab):
    lab.bus.ask(endpoints.EPISODE, FLATTEN.model_copy(update={"candidates": 20, "stop_ni": 1e12}))
    assert lab.cell.leases[0] == "acquire"
    assert "renew" in lab.cell.leases
    assert lab.cell.leases[-1] == "release"


def test_a_robot_held_by_somebody_else_is_left_alone(lab):
    lab.bus.ask(endpoints.LEASE, LeaseRequest(holder="somebody/else"))
    with pytest.raises(LeaseHeld):
        lab.bus.ask(endpoints.EPISODE, FLATTEN)
    assert not lab.cell.acts


def test_an_episode_needs_a_referee(real_lab):
    with pytest.raises(Unavailable, match="referee"):
        real_lab.bus.ask(endpoints.EPISODE, FLATTEN)
    assert not real_lab.cell.leases


def test_an_error_ends_the_episode_with_the_robot_free(lab):
    lab.members["dynamics-1"].close()
    with pytest.raises(Unavailable, match="dynamics"):
        lab.bus.ask(endpoints.EPISODE, FLATTEN)
    assert lab.cell.lessor.holder is None


def test_another_category_than_the_one_laid_out_is_said_so(lab):
    with pytest.raises(BadRequest, match="lays out"):
        lab.bus.ask(endpoints.EPISODE, FLATTEN.model_copy(update={"category": "dress"}))


def test_executing_a_plan_twice_moves_once(lab):
    plan = lab.bus.ask(endpoints.PLAN, PLAN.model_copy(update={"method": "random"}))
    first, again = (lab.bus.ask(endpoints.EXECUTE, ExecuteRequest(plan_id=plan.plan_id)) for _ in range(2))
    assert lab.cell.acts == [plan.plan_id]
    assert not first.replayed
    assert again.replayed
    assert again.grasped == first.grasped
    assert lab.cell.lessor.holder is None


def test_a_plan_to_do_nothing_moves_nothing(lab):
    lab.cell.lay(lab.cell.flat)
    plan = lab.bus.ask(endpoints.PLAN, PLAN.model_copy(update={"candidates": 3}))
    assert plan.no_op
    assert not lab.bus.ask(endpoints.EXECUTE, ExecuteRequest(plan_id=plan.plan_id)).grasped
    assert not lab.cell.acts


def test_only_the_last_plans_are_kept(lab):
    first, *_ = [lab.bus.ask(endpoints.PLAN, PLAN.model_copy(update={"method": "random"})) for _ in range(5)]
    for forgotten in (first.plan_id, "never made"):
        with pytest.raises(NotFound):
            lab.bus.ask(endpoints.EXECUTE, ExecuteRequest(plan_id=forgotten))
