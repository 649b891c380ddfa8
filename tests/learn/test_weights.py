"""Weights as folders: what is read back computes the same, and what does not fit is refused."""

import json

import pytest
import torch
from torch import nn

from medor_learn import weights
from medor_learn.errors import WeightsError


def build(config):
    torch.manual_seed(config.get("init", 0))
    width = config["width"]
    layers = nn.Conv2d(2, width, 3), nn.BatchNorm2d(width), nn.Conv2d(width, 1, 1)
    return nn.Sequential(*layers).to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]


@pytest.fixture
def trained():
    module = build({"width": 4, "init": 7})
    module(torch.randn(8, 2, 6, 6) * 3 + 1)  # moves the norm's statistics
    return module.eval()


def test_a_network_comes_back_as_it_was(tmp_path, trained):
    weights.save(tmp_path, trained, {"width": 4}, {"Data": "waves"})
    loaded, config = weights.load(tmp_path, build)
    x = torch.randn(3, 2, 6, 6)
    assert torch.equal(loaded(x), trained(x))
    assert not loaded.training
    assert config == {"width": 4}


def test_shipped_weights_are_half_as_large_and_nearly_as_good(tmp_path):
    module = build({"width": 64}).eval()
    weights.save(tmp_path / "full", module, {"width": 64}, {})
    (tmp_path / "full" / "templates.npz").write_bytes(b"beside the weights")
    weights.ship(tmp_path / "full", tmp_path / "half")
    size = {name: (tmp_path / name / "weights.safetensors").stat().st_size for name in ("full", "half")}
    assert size["half"] < 0.75 * size["full"]
    assert (tmp_path / "half" / "templates.npz").read_bytes() == b"beside the weights"
    loaded, _ = weights.load(tmp_path / "half", build)
    assert all(tensor.dtype != torch.float16 for tensor in loaded.state_dict().values())
    x = torch.randn(3, 2, 6, 6)
    torch.testing.assert_close(loaded(x), module(x), rtol=0, atol=2e-3)


def test_weights_of_another_network_are_refused(tmp_path, trained):
    weights.save(tmp_path, trained, {"width": 5}, {})
    with pytest.raises(WeightsError, match=r"0\.weight has shape \(4, 2, 3, 3\) instead of \(5, 2, 3, 3\)"):
        weights.load(tmp_path, build)


def test_missing_and_unknown_tensors_are_named(tmp_path, trained):
    weights.save(tmp_path, nn.Sequential(trained[0]), {"width": 4}, {})
    with pytest.raises(WeightsError, match=r"1\.bias is missing.* and \d+ more"):
        weights.load(tmp_path, build)
    weights.save(tmp_path, trained, {"width": 4}, {})
    with pytest.raises(WeightsError, match=r"1\.bias is unknown"):
        weights.load(tmp_path, lambda config: nn.Sequential(build(config)[0]))


def test_a_folder_that_holds_no_network_is_refused(tmp_path, trained):
    with pytest.raises(WeightsError, match=r"config\.json"):
        weights.load(tmp_path / "nowhere", build)
    weights.save(tmp_path, trained, {"width": 4}, {})
    (tmp_path / "weights.safetensors").write_bytes(b"not a file of tensors")
    with pytest.raises(WeightsError, match="safetensors"):
        weights.load(tmp_path, build)


def test_the_card_tells_people_what_the_config_tells_programs(tmp_path, trained):
    weights.save(tmp_path, trained, {"width": 4}, {"Data": "shirts", "metrics": {"score": 0.5}})
    card = (tmp_path / "card.md").read_text()
    assert "## Data\n\nshirts" in card
    assert json.dumps({"score": 0.5}, indent=2) in card
