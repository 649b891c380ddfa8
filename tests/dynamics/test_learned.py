import numpy as np
import pytest
import torch

from medor_dynamics.learned import Learned, learned
from medor_dynamics.rollout import CHUNK
from medor_learn import weights
from medor_wire.bus import Call
from medor_wire.errors import BadRequest
from medor_wire.messages import ClothMesh, RolloutProgress

ABOVE = np.array([0, 0, 0.01], np.float32)


@pytest.fixture
def backend(model) -> Learned:
    return Learned(model().predictor(), threads=1)


def pulls_of(mesh: ClothMesh, count: int = 6) -> tuple[np.ndarray, np.ndarray]:
    picks = mesh.vertices[np.linspace(0, len(mesh.vertices) - 1, count).astype(int)] + ABOVE
    return picks, picks + np.array([0.05, 0.02, 0.03], np.float32)


def test_progress_counts_every_candidate(backend, sheet, request_for):
    mesh = sheet()
    picks, places = pulls_of(mesh, 2 * CHUNK + 1)
    picks[0, 2] += 1
    told: list = []
    backend.roll_out(request_for(mesh, picks, places), Call(progress=told.append))
    assert [progress.done for progress in told] == [CHUNK + 1, 2 * CHUNK + 1]
    assert all(isinstance(progress, RolloutProgress) and progress.total == len(picks) for progress in told)


def test_a_diverged_rollout_is_never_the_best_one(model, sheet, request_for):
    broken = model()
    broken.normalizer.acceleration_scale.fill_(1e30)
    mesh = sheet()
    rollouts = Learned(broken.predictor(), threads=1).roll_out(request_for(mesh, *pulls_of(mesh)), Call())
    assert np.isfinite(rollouts.positions).all()
    assert (rollouts.rewards < 0).all()


def test_weights_that_are_missing_are_said_so_with_the_way_to_them(tmp_path, sheet, request_for):
    mesh = sheet()
    request = request_for(mesh, *pulls_of(mesh))
    with pytest.raises(BadRequest, match=r"medor_dynamics\.train --preset cpu"):
        learned(tmp_path / "none", 1, torch.float32).roll_out(request, Call())


def test_weights_are_read_from_their_folder(tmp_path, model, sheet, request_for):
    trained = model(seed=4)
    weights.save(tmp_path, trained, {"preset": vars(trained.preset)}, {})
    request = request_for(sheet(), *pulls_of(sheet()))
    read = learned(tmp_path, 1, torch.float32).roll_out(request, Call())
    np.testing.assert_allclose(
        read.positions, Learned(trained.predictor(), 1).roll_out(request, Call()).positions, atol=1e-6
    )
