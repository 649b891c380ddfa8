"""The command that teaches completion, from a data set to weights that complete a view."""

import json

import numpy as np
import pytest

from medor_learn.errors import WeightsError
from medor_recon.completion.augment import Augmentation
from medor_recon.completion.field import FieldConfig
from medor_recon.completion.field_completion import FieldCompletion
from medor_recon.completion.fill import FillConfig
from medor_recon.completion.observations import observations
from medor_recon.completion.predictions import Predictions
from medor_recon.completion.presets import PRESETS, Preset
from medor_recon.completion.template_completion import TemplateCompletion
from medor_recon.completion.turn import turns
from medor_recon.completion.weights import build, load
from medor_recon.train.completion import completion


@pytest.fixture
def small(monkeypatch):
    network = FillConfig(pooled=32, summary=16, hidden=(32,))
    monkeypatch.setitem(PRESETS, "cpu", Preset(network, 0.008, Augmentation(), 2, 3e-3, 100, templates=2))


def test_the_command_learns_and_its_folder_completes_a_view(small, data, seen, tmp_path, capsys):
    completion(("tshirt",), (data,), tmp_path, steps=40, validate_every=20)
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert said["ended"] == "finished"
    assert said["meshes"]["true"]["failed"] == 0
    log = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert log[-1]["score"] == log[-1]["error_cm"]
    trained = load(tmp_path / "best")
    assert isinstance(trained, TemplateCompletion)
    assert trained.templates["tshirt"].seeds.tolist() == [4]
    np.testing.assert_allclose(trained.complete(seen).positions[:, 2], 0.005, atol=0.03)


@pytest.mark.parametrize("steps", [1, 40])
def test_a_field_is_taught_by_the_same_command_and_gets_its_threshold(data, tmp_path, capsys, monkeypatch, steps):
    """One that has learnt nothing, too: its run ends in order, its views are refused."""
    network = FieldConfig(0, (16, 8), 8, 8, 2, 8, (32,), False, True, True, 100.0, 16)
    monkeypatch.setitem(PRESETS, "paper-small", Preset(network, 0.01, Augmentation(), 1, 1e-2, 300))
    completion(("tshirt",), (data,), tmp_path, "paper-small", steps=steps, validated=2, bf16=False)
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert 0 <= said["meshes"]["true"]["failed"] <= 1
    trained = load(tmp_path / "best")
    assert isinstance(trained, FieldCompletion)
    assert 0 < trained.thresholds["tshirt"] < 1
    assert trained.spacing == 0.01


def test_predictions_are_kept_and_know_their_turn(data, tmp_path):
    """A canonicaliser that takes every view for the garment turned round."""
    half = turns("tshirt")[1]
    found = observations(data, ("tshirt",), 0.01)[3]
    asked = []

    def canonicalize(category, depth, camera):
        from medor_recon.completion.observations import truth

        asked.append(category)
        view = truth(found.trajectory, (len(asked) - 1) % 5)
        return type(view)(category, view.pixels, view.points, half(view.nocs), view.confidence, view.features, camera)

    predictions = Predictions(canonicalize, tmp_path, 0.01)
    prediction = predictions(found)
    np.testing.assert_allclose(prediction.turn.matrix, half.matrix)
    np.testing.assert_allclose(prediction.pixels.nocs, half(found.true.nocs), atol=1e-3)
    np.testing.assert_array_equal(prediction.pixels.points, found.true.points)
    again = predictions(found)
    assert len(asked) == 5
    np.testing.assert_array_equal(again.pixels.nocs, prediction.pixels.nocs)


def test_a_folder_without_templates_and_a_foreign_config_are_refused(small, data, tmp_path):
    completion(("tshirt",), (data,), tmp_path, steps=1)
    (tmp_path / "best" / "templates-tshirt.npz").unlink()
    with pytest.raises(WeightsError, match="templates of tshirt"):
        load(tmp_path / "best")
    with pytest.raises(WeightsError, match="field or fill"):
        build({"kind": "canonical"})
