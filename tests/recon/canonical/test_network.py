"""Networks: the published shapes, and that each of them can learn."""

from dataclasses import replace

import pytest
import torch

from medor_recon.canonical.network import ImageNetwork, PointNetwork, build
from medor_recon.canonical.preset import CPU, GARMENTNETS, PAPER, PRESETS, Preset
from medor_recon.canonical.symmetry import cross_entropy, rotations

TINY = replace(CPU, width=8, modules=(1, 1), blocks=1, stem=16, hidden=32, size=64, pixels=40)


def parameters(module) -> float:
    return sum(parameter.numel() for parameter in module.parameters()) / 1e6


def seen(preset: Preset, views: int = 3, device: str = "cpu"):
    if preset.network == "pointnet":
        return (torch.rand(views, preset.pixels, 3, device=device) * 0.3,)
    channels = 2 if preset.heights else 1
    image = torch.randn(views, channels, preset.size, preset.size, device=device)
    return image, torch.rand(views, preset.pixels, 2, device=device)


def test_the_papers_network_has_its_shapes_and_its_size():
    with torch.device("meta"):
        network = ImageNetwork(PAPER)
        maps = network.backbone(torch.empty(2, 1, 200, 200))
        said = network(*seen(PAPER, 2, "meta"), torch.zeros(2, dtype=torch.long))
    assert [tuple(x.shape[1:]) for x in maps] == [(32, 50, 50), (64, 25, 25), (128, 13, 13), (256, 7, 7)]
    assert parameters(network.backbone) + parameters(network.head) == pytest.approx(29.6, abs=0.3)
    assert said.logits.shape == (2, 2000, 3, 64)
    assert said.features.shape == (2, 2000, 480)
    assert PAPER.channels + 3 * 3 == 489


def test_the_small_network_is_small():
    with torch.device("meta"):
        network = build({"preset": CPU.to_json(), "categories": ["tshirt"]})
    assert parameters(network) < 2
    assert CPU.channels == 240


@pytest.mark.parametrize("name", PRESETS)
def test_presets_survive_json(name):
    assert Preset.from_json(PRESETS[name].to_json()) == PRESETS[name]


@pytest.mark.parametrize(
    "preset", [TINY, replace(TINY, head="map", head_norm=True), replace(TINY, norm="group"),
               replace(TINY, bottlenecks=1, heights=False)]
)  # fmt: skip
def test_an_image_network_learns_a_batch_by_heart(preset):
    assert overfitted(ImageNetwork(preset), preset) < 0.5


def test_a_point_network_learns_a_batch_by_heart():
    preset = replace(GARMENTNETS, pixels=64, hidden=64)
    network = PointNetwork(preset)
    for module in network.modules():
        if isinstance(module, torch.nn.Dropout):
            module.p = 0.0
    assert overfitted(network, preset) < 0.8


def overfitted(network, preset) -> float:
    """Loss of one batch after some steps, as a share of the loss before."""
    torch.manual_seed(0)
    inputs, nocs, category = seen(preset), torch.rand(3, preset.pixels, 3), torch.zeros(3, dtype=torch.long)
    optimizer = torch.optim.AdamW(network.parameters(), 3e-3)
    losses = []
    for _ in range(40):
        loss = cross_entropy(network(*inputs, category).logits, nocs, rotations("trousers"))[0].mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    return losses[-1] / losses[0]


def test_views_do_not_influence_each_other():
    torch.manual_seed(0)
    for preset, network in ((TINY, ImageNetwork), (replace(GARMENTNETS, pixels=64), PointNetwork)):
        module, inputs = network(preset).eval(), seen(preset)
        category = torch.zeros(3, dtype=torch.long)
        together = module(*inputs, category)
        alone = module(*(part[1:2] for part in inputs), category[1:2])
        torch.testing.assert_close(alone.logits, together.logits[1:2], atol=1e-4, rtol=1e-4)


def test_one_network_for_all_is_told_the_category():
    torch.manual_seed(0)
    module = ImageNetwork(TINY, categories=5).eval()
    inputs = seen(TINY, 2)
    shirt, skirt = (module(*inputs, torch.full((2,), number)).logits for number in (0, 3))
    assert (shirt - skirt).abs().max() > 0.01


def test_every_parameter_is_learnt():
    module = ImageNetwork(TINY, categories=2)
    said = module(*seen(TINY), torch.tensor([0, 1, 1]))
    (said.logits.square().mean() + said.side.square().mean()).backward()
    still = [name for name, p in module.named_parameters() if p.grad is None or not p.grad.any()]
    assert still == []


def test_a_network_that_was_not_taught_sides_leaves_coordinates_as_they_are():
    module = ImageNetwork(replace(TINY, side=0.0))
    side = module(*seen(TINY), torch.zeros(3, dtype=torch.long)).side
    assert side.softmax(-1)[:, 0].min() > 0.999
