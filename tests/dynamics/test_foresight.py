from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from medor_dynamics.evaluate import motionless_errors, rollout_errors
from medor_dynamics.foresight import Foresight
from medor_dynamics.model import Dynamics
from medor_dynamics.preset import CPU
from medor_dynamics.rollout import Pulls, roll_out
from medor_dynamics.samples import Recording, Sampler
from medor_dynamics.shipped import build, load
from medor_learn.loop import Schedule, train

TINY = replace(CPU, width=32, blocks=3)
CARD = {"preset": {**vars(TINY)}}


def task_of(folded: Recording, size: int = 4, **options: Any) -> Foresight:
    torch.manual_seed(0)
    return Foresight(Dynamics(TINY), Sampler([folded], size=size, **options), [folded])


def test_one_recording_is_learnt(folded, tmp_path):
    """Steps are foreseen far better than by going on as before, and the weights kept are those of the best score."""
    task = task_of(folded, size=8)
    summary = train(task, tmp_path, Schedule(steps=120, lr=3e-3, warm_up=20, validate_every=60), card=CARD)
    going_on = task_of(folded, size=8)
    assert isinstance(going_on.module, Dynamics)
    for parameter in going_on.module.network.decode[4].parameters():
        torch.nn.init.zeros_(parameter)
    with torch.no_grad():
        learnt, naive = (np.mean([float(each.loss(step)) for step in range(10)]) for each in (task, going_on))
    assert learnt < 0.6 * naive
    kept = load(tmp_path / "best")
    assert kept.preset == TINY
    assert rollout_errors(kept, [folded])[:, -1] == pytest.approx(summary["best"]["score"], rel=1e-5)


@pytest.mark.slow
def test_one_recording_is_learnt_by_heart(folded, tmp_path):
    """A model that has seen one pull often enough foresees all of it, far better than that nothing moves."""
    task = task_of(folded, size=8, noise=0.01)
    schedule = Schedule(steps=500, lr=3e-3, warm_up=20, validate_every=100)
    best = train(task, tmp_path, schedule, card=CARD)["best"]
    assert best["score"] < 0.5 * best["no_motion"]


def test_the_unrolled_loss_of_one_step_is_the_squared_error_of_the_acceleration(folded):
    task = task_of(folded)
    batch = Sampler([folded], size=4).draw(5)
    model = task.module
    assert isinstance(model, Dynamics)
    after = model(batch.graphs, batch.motion, batch.grips[0])
    accelerations = [
        (to - batch.motion.positions) / 0.05 - batch.motion.velocities[:, 0]
        for to in (after.positions, batch.targets[0])
    ]
    free = torch.ones(len(after.positions), dtype=torch.bool)
    free[batch.grips[0].nodes] = False
    error = ((accelerations[0] - accelerations[1])[free] / 0.05 / model.normalizer.acceleration_scale).square()
    share = free.float().mean()
    assert float(task.loss(5).detach()) == pytest.approx(float((error.mean() * share).detach()), rel=0.05)


def test_longer_stretches_teach_the_same_network(folded):
    loss = task_of(folded, steps=3).loss(0)
    loss.backward()
    assert torch.isfinite(loss)


def test_training_goes_on_where_it_was_cut_off(folded, tmp_path):
    schedule = Schedule(steps=5, warm_up=2, checkpoint_s=0)
    whole, cut, resumed = (task_of(folded, noise=0.1, mirror=True) for _ in range(3))
    train(whole, tmp_path / "whole", schedule, card=CARD)

    def power_cut(step: int, loss: float) -> None:
        if step == 3:
            raise ConnectionAbortedError

    with pytest.raises(ConnectionAbortedError):
        train(cut, tmp_path / "cut", schedule, card=CARD, on_step=power_cut)
    train(resumed, tmp_path / "cut", schedule, card=CARD)
    for ours, theirs in zip(whole.module.parameters(), resumed.module.parameters(), strict=True):
        torch.testing.assert_close(ours, theirs, rtol=0, atol=0)


def test_the_same_seed_gives_the_same_model(folded, tmp_path):
    tasks = [task_of(folded) for _ in range(2)]
    for task, name in zip(tasks, "ab", strict=True):
        train(task, tmp_path / name, Schedule(steps=3, warm_up=1), card=CARD)
    one, two = (list(task.module.parameters()) for task in tasks)
    for ours, theirs in zip(one, two, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=0, atol=0)


def test_what_is_validated_is_what_a_plan_gets(folded):
    """The error of recordings, rolled out many at a time, is that of the rollout of their mesh and pull."""
    model = task_of(folded).module
    assert isinstance(model, Dynamics)
    from medor_dynamics.graphs import Graphs

    start = folded.positions[0]
    graph = Graphs.of([len(start)], [folded.edges], [folded.rest])
    after = roll_out(model.predictor(), graph, start, Pulls(np.array([folded.node]), 10 * folded.step[None]))[0]
    error = np.linalg.norm(after - folded.positions[-1], axis=1).mean()
    assert rollout_errors(model, [folded] * 3)[:, -1] == pytest.approx([error] * 3, rel=1e-4)


def test_the_error_of_standing_still_is_the_distance_travelled(folded):
    travelled = np.linalg.norm(folded.positions[5] - folded.positions[0], axis=1).mean()
    assert motionless_errors([folded])[0, 4] == pytest.approx(travelled)


def test_a_config_builds_its_model():
    assert build(CARD).preset == TINY
