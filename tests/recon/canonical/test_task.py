"""What is learnt from: every view once an epoch, the same for the same seed, and judged fairly."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from medor_recon.canonical.batches import Batch
from medor_recon.canonical.head import to_bins
from medor_recon.canonical.measures import Judgement, summary
from medor_recon.canonical.network import Prediction, build
from medor_recon.canonical.preset import CPU
from medor_recon.canonical.symmetry import rotations, turned
from medor_recon.canonical.task import CanonicalTask
from medor_recon.canonical.views import Views

PRESET = replace(CPU, width=8, modules=(1,), blocks=1, stem=16, hidden=32, size=64, pixels=32, batch=4)


@pytest.fixture(scope="module")
def views(write_data):
    return Views.read([write_data("skirt"), write_data("tshirt")], ["tshirt", "skirt"], "train")


@pytest.fixture
def task(views):
    return made(views)


def made(views, seed=0):
    torch.manual_seed(0)
    module = build({"preset": PRESET.to_json(), "categories": ["tshirt", "skirt"]})
    return CanonicalTask(module, PRESET, views, views, seed)


def test_an_epoch_shows_every_view_once_and_the_next_another_order(task):
    shown = np.concatenate([task.rows(step) for step in range(5)])
    epochs = shown[:10], shown[10:]
    assert [sorted(epoch) for epoch in epochs] == [list(range(10))] * 2
    assert epochs[0].tolist() != epochs[1].tolist()


def test_a_step_is_the_same_whatever_came_before_it(views):
    first, second = made(views), made(views)
    second.loss(0)
    assert torch.equal(first.loss(6), second.loss(6))
    assert not torch.equal(first.loss(6), made(views, seed=1).loss(6))


def test_the_loss_of_a_batch_is_the_mean_over_its_views_whatever_their_category(task):
    class Sure(torch.nn.Module):
        """Right about shirts, half a turn off for two skirts, wrong about the third."""

        def forward(self, nocs, category):
            return Prediction(
                50 * torch.nn.functional.one_hot(to_bins(nocs, 64), 64).float(), nocs, torch.zeros(len(nocs), 2)
            )

    nocs = 0.5 + 0.4 * (torch.rand(4, 30, 3) - 0.5)
    said = nocs.clone()
    said[1:3] = turned(nocs[1:3], rotations("skirt"))[6]
    said[3] = said[3].roll(7, 0)
    task.module = Sure()
    category = torch.tensor([0, 1, 1, 1])
    side = PRESET.side * np.log(2)  # of the one shirt, undecided
    alone = task.loss_of(Batch((said[3:],), category[3:], nocs[3:], np.zeros(0, np.float32)))
    assert alone > 5
    together = task.loss_of(Batch((said,), category, nocs, np.zeros(0, np.float32)))
    assert float(together) == pytest.approx((float(alone) + side) / 4, rel=1e-4)


def test_validation_is_the_same_every_time_and_averages_categories(task):
    task.module.eval()
    with torch.no_grad():
        metrics, again = task.validate(), task.validate()
    assert metrics == again
    assert metrics["score"] == pytest.approx((metrics["tshirt/aware"] + metrics["skirt/aware"]) / 2)
    assert "tshirt/side_right" in metrics
    assert "skirt/side_right" not in metrics


def judged(category, turn, side, noise=0.0):
    """Views predicted after a turn, up to noise."""
    true = 0.5 + 0.4 * (torch.rand(2, 500, 3, generator=torch.Generator().manual_seed(0)) - 0.5)
    predicted = turned(true, rotations(category))[turn]
    predicted = predicted + torch.tensor([noise, 0, 0])
    return summary(Judgement.of(category, predicted, true, torch.tensor([side, side])))


def test_a_turned_answer_is_right_up_to_symmetry_and_wrong_as_it_is():
    found = judged("tshirt", 1, [5.0, 0.0])
    assert found["aware"] == pytest.approx(0, abs=1e-6)
    assert found["plain"] > 0.1
    assert found["side_right"] == 0
    assert found["side_sure"] > 0.99


def test_a_turned_answer_whose_side_is_known_is_right():
    found = judged("tshirt", 1, [0.0, 5.0])
    assert found["plain"] == pytest.approx(0, abs=1e-6)
    assert found["side_right"] == 1


def test_a_skirt_has_no_side_to_be_wrong_about():
    found = judged("skirt", 5, [0.0, 5.0])
    assert found["aware"] == pytest.approx(0, abs=1e-6)
    assert found["plain"] > 0.1
    assert "side_right" not in found


def test_errors_come_in_sides_of_the_cube_and_in_centimetres():
    found = judged("tshirt", 0, [5.0, 0.0], noise=0.06)
    assert found["aware"] == pytest.approx(0.06, abs=1e-4)
    assert found["aware_cm"] == pytest.approx(0.06 * 60.6, rel=1e-3)
    assert (found["aware_near"], found["aware_fair"]) == (0, 1)
