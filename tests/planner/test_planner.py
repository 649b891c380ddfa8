import threading
import time

import numpy as np
import pytest

from medor_wire import endpoints
from medor_wire.errors import BadRequest, Cancelled, Unavailable
from medor_wire.messages import ExecuteRequest, Plan, PlanProgress, PlanRequest

ORACLE = PlanRequest(category="tshirt", method="oracle", candidates=12, seed=5)


def action(plan: Plan) -> list[float]:
    return [*plan.pick, *plan.place, plan.reward]


def test_a_folded_sleeve_is_pulled_open(lab):
    before = lab.bus.ask(endpoints.SCORE, endpoints.SCORE.request())
    plan = lab.bus.ask(endpoints.PLAN, ORACLE)
    assert not plan.no_op
    assert plan.reward > plan.no_op_reward == pytest.approx(before.coverage_m2, rel=0.02)
    lab.bus.ask(endpoints.EXECUTE, endpoints.EXECUTE.request(plan_id=plan.plan_id))
    after = lab.bus.ask(endpoints.SCORE, endpoints.SCORE.request())
    assert after.coverage_m2 > 1.02 * before.coverage_m2
    assert after.coverage_m2 == pytest.approx(plan.reward, rel=0.1)


def test_the_best_candidates_come_best_first_and_the_plan_is_the_first(lab):
    plan = lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"candidates": 24}))
    assert (np.diff(plan.top_rewards) <= 0).all()
    assert len(plan.top_picks) == 20
    assert plan.candidates == 24
    np.testing.assert_array_equal(plan.pick, plan.top_picks[0].astype(np.float64))
    assert plan.reward == plan.top_rewards[0]


def test_every_stage_is_timed_and_told(lab):
    told: list[PlanProgress] = []
    plan = lab.bus.ask(endpoints.PLAN, ORACLE, on_progress=told.append)
    assert {"capture", "reconstruct", "goals", "sample", "rollout", "total"} == set(plan.timings_ms)
    assert plan.timings_ms["total"] >= plan.timings_ms["rollout"] > 0
    stages = [progress.stage for progress in told]
    assert sorted(set(stages), key=stages.index) == ["capture", "reconstruct", "goals", "sample", "rollout"]
    rollout = [progress.fraction for progress in told if progress.stage == "rollout"]
    assert rollout == sorted(rollout)
    assert rollout[-1] == 1.0


def test_same_seed_same_plan_other_seed_another(lab):
    one, two = (lab.bus.ask(endpoints.PLAN, ORACLE) for _ in range(2))
    other = lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"seed": 6}))
    assert action(one) == action(two)
    assert one.plan_id != two.plan_id
    assert action(one) != action(other)


def test_on_a_flat_garment_there_is_nothing_to_gain(lab):
    lab.cell.lay(lab.cell.flat)
    plan = lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"candidates": 6}))
    assert plan.reward == pytest.approx(plan.no_op_reward, rel=1e-3), "nothing to gain"
    assert plan.no_op == (plan.reward == plan.no_op_reward) == np.array_equal(plan.pick, plan.place)
    assert plan.top_rewards.max() <= plan.reward


def test_the_plan_is_the_same_when_one_of_two_replicas_is_lost_in_the_middle(lab):
    whole = lab.bus.ask(endpoints.PLAN, ORACLE)
    lab.add_dynamics("dynamics-2")
    lost = threading.Event()

    def lose_one(progress: PlanProgress) -> None:
        if progress.stage == "rollout" and 0 < progress.fraction < 1 and not lost.is_set():
            lost.set()
            threading.Thread(target=lab.members["dynamics-2"].close).start()

    plan = lab.bus.ask(endpoints.PLAN, ORACLE, on_progress=lose_one)
    assert lost.is_set()
    assert action(plan) == action(whole)
    np.testing.assert_array_equal(plan.top_rewards, whole.top_rewards)


def test_without_dynamics_a_plan_is_unavailable_soon(lab):
    lab.members["dynamics-1"].close()
    start = time.monotonic()
    with pytest.raises(Unavailable, match="dynamics"):
        lab.bus.ask(endpoints.PLAN, ORACLE)
    assert time.monotonic() - start < 6


def test_cancelling_a_plan_is_prompt(lab):
    cancel = threading.Event()
    asked = ORACLE.model_copy(update={"candidates": 2000})
    start = time.monotonic()

    def stop(progress: PlanProgress) -> None:
        if progress.stage == "rollout" and progress.fraction > 0:
            cancel.set()

    with pytest.raises(Cancelled):
        lab.bus.ask(endpoints.PLAN, asked, on_progress=stop, cancel=cancel)
    assert time.monotonic() - start < 5
    assert lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"candidates": 2})).candidates == 2


def test_places_out_of_reach_are_not_rolled_out(lab):
    lab.cell.in_reach = lambda points: points[:, 1] > 0
    plan = lab.bus.ask(endpoints.PLAN, ORACLE)
    assert min(plan.top_picks[:, 1].min(), plan.top_places[:, 1].min()) > 0


def test_who_picks_is_asked_for_its_reach_and_does_the_picking(lab):
    plan = lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"executor": "panda"}))
    assert set(lab.cell.asked_reach_of) == {"panda"}
    lab.bus.ask(endpoints.EXECUTE, ExecuteRequest(plan_id=plan.plan_id))
    assert lab.cell.executors == ["panda"]


def test_the_visible_method_plans_on_what_the_camera_sees(lab):
    plan = lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"method": "visible", "candidates": 8}))
    assert len(plan.mesh.vertices) < len(lab.cell.positions)
    assert plan.mesh.visible.all()
    assert np.isfinite(plan.top_rewards).all()


@pytest.mark.parametrize("method", ["oracle", "visible"])
def test_canonicalize_rewards_are_distances_to_the_goal(lab, method):
    asked = ORACLE.model_copy(update={"method": method, "task": "canonicalize", "candidates": 6})
    plan = lab.bus.ask(endpoints.PLAN, asked)
    assert -0.2 < plan.no_op_reward <= plan.reward < 0


def test_the_random_method_needs_no_dynamics_and_goes_off_the_cloth(lab):
    lab.members["dynamics-1"].close()
    plan = lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"method": "random"}))
    away = np.linalg.norm(lab.cell.positions[:, :2] - plan.place[:2], axis=1).min()
    assert not plan.no_op
    assert away > 0.01


def test_the_oracle_needs_a_simulator(real_lab):
    with pytest.raises(Unavailable, match="sim"):
        real_lab.bus.ask(endpoints.PLAN, ORACLE)


def test_a_wrong_category_or_method_is_said_so(lab):
    with pytest.raises(BadRequest, match="tshirt lies"):
        lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"category": "skirt"}))
    with pytest.raises(BadRequest, match="visible, oracle, oracle-mesh, random"):
        lab.bus.ask(endpoints.PLAN, ORACLE.model_copy(update={"method": "telepathy"}))
