"""The judge: told what models foresee and what is seen, says what an action will bring."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from medor_cloth.alignment import canonical_cost
from medor_cloth.camera import Camera
from medor_planner.judge import situation as stored
from medor_planner.judge.collect import Garment
from medor_planner.judge.collect import Options as CollectOptions
from medor_planner.judge.features import features
from medor_planner.judge.glance import Glance
from medor_planner.judge.judge import SHIPPED, Judge, rewards
from medor_planner.judge.lessons import Lessons, gained
from medor_planner.judge.merit import best_few, merit
from medor_planner.judge.opinions import COARSE, OPINIONS
from medor_planner.judge.relief import CELL_M, Relief
from medor_planner.judge.situation import Outcomes, Situation
from medor_planner.judge.train import Options, earlier, judged_unseen, said, taught, write
from medor_planner.judge.train import main as train
from medor_planner.planner import GLANCES, Planner
from medor_planner.plans import Plans
from medor_planner.sampling import Candidates
from medor_wire import endpoints
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, NoGarment
from medor_wire.messages import CameraInfo, DepthView, Empty, PlanRequest
from tests.planner.decisions import COUNT, turned


def test_a_relief_measures_what_is_seen(sheet_scene, camera):
    relief = Relief.of(sheet_scene().view, camera)
    assert relief.area_m2 == pytest.approx(0.2 * 0.24, rel=0.04)
    assert relief.at(relief.heights, np.zeros(2)) == pytest.approx(0.005, abs=5e-4)
    assert relief.at(relief.inside, np.zeros(2)) == pytest.approx(0.1, abs=2 * CELL_M)
    assert relief.at(relief.outside, np.array([0.15, 0])) == pytest.approx(0.05, abs=2 * CELL_M)
    assert relief.rim_m == pytest.approx(0.538 / 2 - 0.12, abs=0.005)


def test_a_relief_of_nothing_is_refused(camera: Camera):
    info = CameraInfo(K=camera.K, T_world_camera=camera.T_world_camera, width=camera.width, height=camera.height)
    with pytest.raises(NoGarment):
        Relief.of(DepthView(depth=np.zeros((240, 240), np.float32), camera=info), camera)


def test_features_do_not_depend_on_where_the_garment_lies_nor_how_it_is_turned(situation):
    names, here = features(situation)
    for heading, shift in ((np.pi / 2, (0.0, 0.0)), (0.0, (0.1, -0.07)), (2.0, (0.03, 0.05))):
        _, there = features(turned(situation, heading, shift))
        heights = np.array(["height_" in name for name in names])  # read off cells, which an edge may fall between
        near = np.isclose(here, there, atol=0.02)
        assert near[:, ~heights].all(), [names[i] for i in np.flatnonzero((~near & ~heights).any(axis=0))]
        assert near[:, heights].mean() > 0.9


def test_each_candidate_has_features_of_its_own(situation):
    order = np.random.default_rng(1).permutation(COUNT)
    some = situation.candidates
    other = replace(
        situation,
        candidates=Candidates(some.picks[order], some.places[order]),
        foreseen={
            name: replace(one, positions=one.positions[[0, *(order + 1)]]) for name, one in situation.foreseen.items()
        },
    )
    np.testing.assert_allclose(features(other)[1], features(situation)[1][order], atol=1e-5)


def test_a_rollout_that_diverged_counts_as_nothing_moved(situation):
    situation.foreseen[OPINIONS[0].name].positions[3] = np.nan
    names, values = features(situation)
    assert np.isfinite(values).all()
    assert values[2, names.index(f"{OPINIONS[0].name} moved_mean")] == 0


def test_what_is_stored_comes_back(situation, tmp_path):
    outcomes = Outcomes(np.arange(13.0), np.arange(13.0) / 100, np.ones(13), 0.05, 7)
    stored.save(tmp_path / "one.npz", situation, outcomes)
    again, told = stored.load(tmp_path / "one.npz")
    assert (told.seed, told.flat_coverage_m2) == (7, 0.05)
    np.testing.assert_array_equal(told.cost_m, outcomes.cost_m)
    np.testing.assert_allclose(features(again)[1], features(situation)[1], atol=0.02)


def test_of_some_candidates_only_those_are_told(situation):
    chosen = np.arange(COUNT) % 3 == 0
    np.testing.assert_allclose(features(situation.among(chosen))[1], features(situation)[1][chosen], atol=1e-6)


def test_an_opinion_that_is_not_heard_is_no_feature(situation):
    names, _ = features(situation.heard([COARSE.name]))
    assert any(name.startswith(COARSE.name) for name in names)
    assert not any(name.startswith(OPINIONS[0].name) for name in names)


def test_cloth_that_leaves_the_picture_is_no_gain():
    kept = gained(Outcomes(np.array([0.02, 0.03]), np.array([0.06, 0.04]), np.array([1.0, 1.0]), 0.04, 0))
    lost = gained(Outcomes(np.array([0.02, 0.03]), np.array([0.06, 0.04]), np.array([1.0, 0.5]), 0.04, 0))
    np.testing.assert_allclose(kept, [[0.25, 0.02]], atol=1e-6)
    np.testing.assert_allclose(lost, [[-0.125, -0.03]], atol=1e-6)


def lessons(states: int) -> Lessons:
    """The third feature tells the gain of coverage, the fourth that of the cost; ten candidates a state."""
    values = np.random.default_rng(0).normal(size=(10 * states, 6)).astype(np.float32)
    gains = values[:, 2:4] * [0.05, 0.008] + [0.01, 0]
    state = np.repeat(np.arange(states), 10)
    return Lessons(tuple("uvwxyz"), values, gains.astype(np.float32), state, state // 2)


def options(folder: Path, **given) -> Options:
    return Options(data=folder, out=folder / "judge", **{"members": 2, "epochs": 30, "folds": 3, **given})


def test_networks_overfit_one_batch(tmp_path):
    data = lessons(13)
    gains = np.random.default_rng(1).normal(size=data.gains.shape).astype(np.float32) * [0.05, 0.008]
    ensemble = taught(data.values, gains, options(tmp_path, epochs=1500, dropout=0, noise=0, decay=0, members=1))
    with torch.no_grad():
        off = ensemble(torch.from_numpy(data.values)).numpy() - gains
    assert np.sqrt((off**2).mean(axis=0)) == pytest.approx([0, 0], abs=0.01)


def test_what_can_be_learnt_is_known_of_unseen_garments(tmp_path):
    data = lessons(60)
    unseen = judged_unseen(data, options(tmp_path))
    for column in (0, 1):
        found = merit(unseen[:, column], data.gains[:, column], data.state)
        best = merit(data.gains[:, column], data.gains[:, column], data.state)
        assert best.rank == pytest.approx(1)
        assert found.rank > 0.9
        assert found.gain > 0.9 * best.gain


def test_few_that_are_best_bring_most():
    data = lessons(20)
    gains = data.gains[:, 0]
    assert best_few(gains, gains, data.state) > best_few(np.zeros_like(gains), gains, data.state)
    assert best_few(gains, gains, data.state) == pytest.approx(gains.reshape(20, 10).max(axis=1).mean(), abs=1e-5)


def test_a_judge_is_taught_from_what_was_collected(situation, tmp_path):
    few = options(tmp_path, epochs=1, folds=0)
    with pytest.raises(SystemExit, match=r"medor_planner\.judge\.collect"):
        train(few)
    outcomes = Outcomes(np.arange(13.0), np.arange(13.0) / 100, np.ones(13), 0.05, 7)
    (tmp_path / stored.DECISIONS).mkdir()
    stored.save(tmp_path / stored.DECISIONS / "one.npz", situation, outcomes)
    train(few)
    assert np.isfinite(Judge.load(few.out).gains(situation)).all()


def test_what_was_taught_is_what_plans_use(tmp_path):
    data, taught_so = lessons(20), options(tmp_path)
    ensemble = taught(data.values, data.gains, taught_so)
    write(ensemble, data, {}, taught_so)
    with torch.no_grad():
        expected = ensemble(torch.from_numpy(data.values)).numpy()
    judge = Judge.load(tmp_path / "judge")
    assert judge.names == data.names
    np.testing.assert_allclose(judge.expected(data.values), expected, atol=1e-6)


def test_a_judge_goes_on_from_what_another_learnt(tmp_path):
    """A hurried pupil of few states knows what the first one did of many, and what is new in its own."""
    many, few = lessons(60), lessons(13)
    new = replace(few, gains=few.gains + np.array([0.05, 0], np.float32))
    first = options(tmp_path)
    write(taught(many.values, many.gains, first), many, {}, first)
    hurried = options(tmp_path, start=first.out, lr=1e-3, epochs=100)
    before, history = earlier(new, hurried)
    assert before is not None
    assert history["data"]["states"] == 60
    on, anew = (said(taught(new.values, new.gains, hurried, start), new.values) for start in (before, None))
    off = [np.abs(gains - new.gains).mean(axis=0) for gains in (said(before, new.values), on, anew)]
    assert off[1][0] < 0.5 * off[0][0]
    assert (off[1] < off[2]).all()


def test_a_judge_does_not_go_on_from_one_of_other_features(tmp_path):
    data, taught_so = lessons(20), options(tmp_path, epochs=1)
    write(taught(data.values, data.gains, taught_so), data, {}, taught_so)
    with pytest.raises(SystemExit, match="other features"):
        earlier(replace(data, names=tuple("abcdef")), options(tmp_path, start=taught_so.out))


def test_a_judge_that_knows_other_features_does_not_decide(tmp_path, situation):
    data, taught_so = lessons(20), options(tmp_path, epochs=1)
    write(taught(data.values, data.gains, taught_so), data, {}, taught_so)
    with pytest.raises(BadRequest, match="other features"):
        Judge.load(tmp_path / "judge").gains(situation)


def test_without_weights_the_command_that_makes_them_is_named(tmp_path):
    with pytest.raises(BadRequest, match=r"medor_planner\.judge\.train"):
        Judge.load(tmp_path)


@pytest.mark.parametrize("task", ["flatten", "canonicalize"])
@pytest.mark.parametrize("who", [Judge, Glance])
def test_what_the_shipped_ones_expect_has_the_units_of_the_task(situation, task, who):
    expected, now = rewards(situation, who.load().gains(situation), task)
    assert expected.shape == (COUNT,)
    if task == "flatten":
        assert now == pytest.approx(Relief.of(situation.view, situation.camera).area_m2)
        assert (np.abs(expected - now) < situation.goals.flat_coverage_m2).all()
    else:
        assert now == pytest.approx(-canonical_cost(situation.mesh.vertices, situation.goals.goals))
        assert (np.abs(expected - now) < 0.1).all()


@pytest.mark.parametrize("method", ["medor+judge", "oracle-mesh+judge"])
def test_a_judged_plan_hears_all_models_and_is_the_same_again(full_lab, method):
    asked = PlanRequest(category="tshirt", method=method, candidates=30, seed=3)
    one, two = (full_lab.bus.ask(endpoints.PLAN, asked) for _ in range(2))
    assert {"reconstruct", "screen", "rollout", "judge"} <= set(one.timings_ms)
    assert (one.candidates, one.survivors) == (30 * GLANCES, 20)
    np.testing.assert_array_equal(one.top_rewards, two.top_rewards)
    assert one.no_op == (one.top_rewards.max() <= one.no_op_reward)
    truth = full_lab.bus.ask(endpoints.TRUTH, Empty()).mesh.vertices
    assert np.array_equal(one.mesh.vertices, truth) == (method == "oracle-mesh+judge")


@pytest.mark.parametrize("judge", [SHIPPED, None])
def test_what_is_collected_can_be_learnt_from(full_lab, tmp_path, judge):
    for folder in (stored.DECISIONS, stored.GLANCES):
        (tmp_path / folder).mkdir()
    few = CollectOptions(tmp_path, pulls=1, drawn=12, best=2, others=1, judge=judge)
    Garment(full_lab.bus, few, "tshirt", 600_900).collect()
    drawn, outcomes = stored.load(tmp_path / stored.DECISIONS / "tshirt-600900-0.npz")
    assert set(drawn.foreseen) == {opinion.name for opinion in OPINIONS}
    assert (len(drawn.candidates), len(outcomes.coverage_m2)) == (3, 4)
    assert 0 < outcomes.coverage_m2[0] < outcomes.flat_coverage_m2
    Garment(full_lab.bus, replace(few, glances=True), "tshirt", 600_900).collect()
    glanced, outcomes = stored.load(tmp_path / stored.GLANCES / "tshirt-600900-0.npz")
    assert (dict(glanced.foreseen), len(outcomes.cost_m), outcomes.seed) == ({}, 4, 600_900)


class LikesLongPulls:
    """A glance that knows only how far pulls go."""

    def gains(self, situation: Situation) -> np.ndarray:
        length = np.linalg.norm(situation.candidates.places - situation.candidates.picks, axis=1)
        return np.stack([length, length], axis=1)


def test_what_a_glance_likes_best_of_many_pulls_is_rolled_out(full_lab, monkeypatch):
    monkeypatch.setattr(Glance, "load", lambda folder: LikesLongPulls())
    planner = Planner(full_lab.bus, Plans(), glances=20)
    plan = planner.plan(
        PlanRequest(category="tshirt", method="medor+judge", candidates=10, exhaustive=True, seed=3), Call()
    )
    assert (plan.candidates, plan.survivors) == (200, 10)
    assert np.linalg.norm(plan.top_places - plan.top_picks, axis=1).min() > 0.185
