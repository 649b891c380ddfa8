"""Training: what a run leaves behind does not depend on how often it was stopped."""

import json
import os
import signal
from dataclasses import replace

import pytest
import torch
from torch import nn

from medor_learn import run, weights
from medor_learn.errors import Diverged, LearnError, ResumeError
from medor_learn.loop import Schedule, train

SCHEDULE = Schedule(steps=24, lr=0.01, warm_up=4, validate_every=8, weight_decay=0.01, seed=5)
CARD = {"preset": "small", "data": {"seed": 1}}


class Waves:
    """An image network with everything that has a state: norms, dropout, a memory format of its own."""

    def __init__(self, noise: float = 0.1) -> None:
        torch.manual_seed(0)
        layers = (
            nn.Conv2d(1, 4, 3, padding=1),
            nn.BatchNorm2d(4),
            nn.ReLU(),
            nn.Dropout(0.2),
            nn.Conv2d(4, 1, 3, padding=1),
        )
        self.module = nn.Sequential(*layers).to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        self.noise = noise

    def loss(self, step):
        generator = torch.Generator().manual_seed(step)
        x = torch.randn(4, 1, 8, 8, generator=generator)
        y = x.roll(1, -1) + self.noise * torch.randn(x.shape, generator=generator)
        return (self.module(x) - y).square().mean().float()

    def validate(self):
        x = torch.linspace(-1, 1, 64).reshape(1, 1, 8, 8)
        return {"score": float((self.module(x) - x.roll(1, -1)).square().mean())}


class OneBatch(Waves):
    """The same four images over and over, and nothing left to chance."""

    def loss(self, step):
        self.module.eval()
        return super().loss(0)


def lines(folder):
    kept = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return [{name: value for name, value in line.items() if name != "hours"} for line in kept]


def same(a: nn.Module, b: nn.Module) -> bool:
    pairs = zip(a.state_dict().values(), b.state_dict().values(), strict=True)
    return all(torch.equal(x, y) for x, y in pairs)


def interrupt_at(step, number=signal.SIGTERM):
    return lambda done, loss: os.kill(os.getpid(), number) if done == step else None


@pytest.mark.parametrize("bf16", [False, True])
def test_a_run_that_was_stopped_ends_as_one_that_was_not(tmp_path, bf16):
    schedule = replace(SCHEDULE, bf16=bf16)
    whole, first, second = Waves(), Waves(), Waves()
    summary = train(whole, tmp_path / "whole", schedule, card=CARD)
    stopped = train(first, tmp_path / "parts", schedule, card=CARD, on_step=interrupt_at(11))
    assert (stopped["ended"], stopped["step"]) == ("interrupted", 11)
    assert not same(first.module, whole.module)
    resumed = train(second, tmp_path / "parts", schedule, card=CARD)
    assert (resumed["ended"], resumed["step"]) == ("finished", 24)
    assert same(second.module, whole.module)
    assert lines(tmp_path / "parts") == lines(tmp_path / "whole")
    assert resumed["best"] == summary["best"]


@pytest.mark.parametrize("fast", [False, True])
def test_bfloat16_is_used_only_where_the_processor_is_fast_at_it(tmp_path, monkeypatch, fast):
    class Watched(Waves):
        def loss(self, step):
            seen.append(torch.is_autocast_enabled("cpu"))
            return super().loss(step)

    seen: list[bool] = []
    monkeypatch.setattr(run, "has_bf16", lambda kind: fast)
    train(Watched(), tmp_path, replace(SCHEDULE, bf16=True), card=CARD)
    assert seen == [fast] * SCHEDULE.steps


def test_going_on_from_an_old_checkpoint_forgets_what_came_after_it(tmp_path):
    train(Waves(), tmp_path, SCHEDULE, card=CARD, on_step=interrupt_at(10))
    old = (tmp_path / "checkpoint.pt").read_bytes()
    train(Waves(), tmp_path, SCHEDULE, card=CARD)
    before = lines(tmp_path)
    (tmp_path / "checkpoint.pt").write_bytes(old)
    train(Waves(), tmp_path, SCHEDULE, card=CARD)
    assert lines(tmp_path) == before
    assert [line["step"] for line in before] == [8, 16, 24]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_with_a_checkpoint_and_leaves_the_handlers_alone(tmp_path, number):
    before = signal.getsignal(number)
    summary = train(Waves(), tmp_path, SCHEDULE, card=CARD, on_step=interrupt_at(3, number))
    assert (summary["ended"], summary["step"]) == ("interrupted", 3)
    assert (tmp_path / "checkpoint.pt").exists()
    assert signal.getsignal(number) is before


def test_a_run_of_another_configuration_is_refused_and_said_how_it_differs(tmp_path):
    train(Waves(), tmp_path, replace(SCHEDULE, steps=2), card=CARD)
    with pytest.raises(ResumeError, match=r"card\.data\.seed was 1, now 2"):
        train(Waves(), tmp_path, SCHEDULE, card=CARD | {"data": {"seed": 2}})
    with pytest.raises(ResumeError, match=r"schedule\.lr was 0\.01, now 0\.02"):
        train(Waves(), tmp_path, replace(SCHEDULE, lr=0.02), card=CARD)
    assert issubclass(ResumeError, LearnError)


def test_a_run_can_be_made_longer(tmp_path):
    train(Waves(), tmp_path, replace(SCHEDULE, steps=8), card=CARD)
    assert train(Waves(), tmp_path, replace(SCHEDULE, steps=16, checkpoint_s=1), card=CARD)["step"] == 16


def test_a_full_run_learns_a_batch_by_heart(tmp_path):
    losses = []
    task = OneBatch(noise=0)
    schedule = Schedule(steps=300, lr=0.03, warm_up=10, validate_every=100)
    train(task, tmp_path, schedule, card=CARD, on_step=lambda step, loss: losses.append(loss))
    assert losses[0] > 0.5
    assert losses[-1] < 0.1 * losses[0]


def test_the_best_weights_are_kept_not_the_last(tmp_path):
    class Worsening(Waves):
        scores = iter([3.0, 1.0, 2.0])
        states: list[dict]

        def validate(self):
            self.states = [*getattr(self, "states", []), {k: v.clone() for k, v in self.module.state_dict().items()}]
            return {"score": next(self.scores)}

    task = Worsening()
    summary = train(task, tmp_path, SCHEDULE, card=CARD)
    best, config = weights.load(tmp_path / "best", lambda config: Waves().module)
    assert summary["best_step"] == config["metrics"]["step"] == 16
    assert config["preset"] == "small"
    assert all(torch.equal(best.state_dict()[name], value) for name, value in task.states[1].items())


def test_patience_ends_a_run_that_gets_no_better(tmp_path):
    class Stuck(Waves):
        def validate(self):
            return {"score": 1.0}

    summary = train(Stuck(), tmp_path, replace(SCHEDULE, patience=1), card=CARD)
    assert (summary["ended"], summary["step"]) == ("patience", 16)


def test_a_loss_that_is_no_number_ends_the_run_and_spares_the_weights(tmp_path):
    class Broken(Waves):
        def loss(self, step):
            return super().loss(step) * (float("nan") if step == 2 else 1)

    task = Broken()
    with pytest.raises(Diverged, match="step 2"):
        train(task, tmp_path, SCHEDULE, card=CARD)
    assert all(torch.isfinite(parameter).all() for parameter in task.module.parameters())


def test_the_learning_rate_rises_and_has_decayed_when_steps_or_hours_are_over():
    schedule = Schedule(steps=1000, hours=2.0, lr=1.0, warm_up=100)
    rates = [schedule.learning_rate(step, 0.0) for step in range(1001)]
    assert rates.index(max(rates)) == pytest.approx(100, abs=5)
    assert rates[0] == pytest.approx(0.01)
    assert rates[-1] == pytest.approx(0.01)
    assert schedule.learning_rate(500, 2.0) == pytest.approx(0.01)
    assert schedule.progress(500, 2.5) == 1


def test_hours_of_cpu_time_end_a_run_and_are_counted_over_resumptions(tmp_path):
    long = replace(SCHEDULE, steps=10**9, hours=0.1 / 3600)
    summary = train(Waves(), tmp_path, long, card=CARD)
    assert summary["ended"] == "finished"
    assert summary["hours"] >= 0.1 / 3600
    again = train(Waves(), tmp_path, long, card=CARD)
    assert again["step"] == summary["step"]


def test_a_run_begins_with_the_weights_of_another_and_says_so(tmp_path):
    train(Waves(), tmp_path / "first", SCHEDULE, card=CARD)
    taught, _ = weights.load(tmp_path / "first" / "best", lambda config: Waves().module)
    second, still = Waves(), replace(SCHEDULE, steps=1, lr=0.0)
    train(second, tmp_path / "second", still, card=CARD, start=tmp_path / "first" / "best")
    learnt = zip(second.module.named_parameters(), taught.parameters(), strict=True)
    assert all(torch.equal(ours, theirs) for (_, ours), theirs in learnt)
    config = weights.read_config(tmp_path / "second" / "best")
    assert config["start"]["data"] == CARD["data"]
    assert config["start"]["metrics"]["step"] == weights.read_config(tmp_path / "first" / "best")["metrics"]["step"]


def test_a_resumed_run_goes_on_from_its_checkpoint_not_from_its_start(tmp_path):
    train(Waves(), tmp_path / "first", replace(SCHEDULE, steps=8), card=CARD)
    start = tmp_path / "first" / "best"
    whole, parts = Waves(), Waves()
    train(whole, tmp_path / "whole", SCHEDULE, card=CARD, start=start)
    train(Waves(), tmp_path / "parts", SCHEDULE, card=CARD, start=start, on_step=interrupt_at(11))
    train(parts, tmp_path / "parts", SCHEDULE, card=CARD, start=start)
    assert same(parts.module, whole.module)
