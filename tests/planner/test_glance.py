"""A glance: pulls as seen from their own side, and what a network learns of them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from medor_planner.judge import situation as stored
from medor_planner.judge.features import features, mirrored
from medor_planner.judge.glance import FOLDER, Glance, GlanceNet, promised
from medor_planner.judge.lessons import Lessons
from medor_planner.judge.patches import (
    HEIGHT_M,
    NEAR,
    NEAR_AHEAD_M,
    NEAR_CELL_M,
    NEAR_CELLS,
    WIDE,
    WIDE_CELLS,
    Maps,
    Patches,
)
from medor_planner.judge.situation import Outcomes, Situation
from medor_planner.judge.train_glance import GlanceTask, Options, Sights
from medor_planner.judge.train_glance import main as train
from medor_planner.sampling import Candidates
from medor_wire.errors import BadRequest
from tests.planner.decisions import COUNT, turned


def seen(situation: Situation) -> Patches:
    return Maps.of(situation).around(situation.candidates)


def sights(patches: Patches, situation: Situation, gains: np.ndarray) -> Sights:
    names, values = features(situation.heard([]))
    alone = np.zeros(COUNT, np.int64)
    return Sights(Lessons(names, values, gains.astype(np.float32), alone, alone), patches)


def collected(situation: Situation, folder: Path) -> None:
    """Lessons of two garments."""
    (folder / stored.GLANCES).mkdir()
    for seed in (7, 8):
        outcomes = Outcomes(np.linspace(0.02, 0.03, 13), np.arange(13.0) / 100, np.ones(13), 0.05, seed)
        stored.save(folder / stored.GLANCES / f"{seed}.npz", situation.heard([]), outcomes)


def test_a_pull_looks_to_the_right_from_the_pick(situation):
    """From the middle of the fold outwards there is cloth at and behind the pick, table before it."""
    outward = Candidates(np.array([[0.034, 0, 0.02]], np.float32), np.array([[0.18, 0, 0.02]], np.float32))
    near = Maps.of(situation).around(outward).near[0].astype(float)
    row, pick = NEAR_CELLS // 2, round((NEAR_CELLS - 1) / 2 - NEAR_AHEAD_M / NEAR_CELL_M)
    cloth = near[NEAR.index("cloth"), row]
    assert cloth[pick - 3 : pick - 1].all()
    assert not cloth[pick + 3 :].any()
    assert near[NEAR.index("height"), row, pick - 4] * HEIGHT_M == pytest.approx(0.011, abs=0.002)


def test_patches_do_not_depend_on_where_the_garment_lies_nor_how_it_is_turned(situation):
    here = seen(situation)
    for heading, shift in ((np.pi / 2, (0.0, 0.0)), (2.0, (0.03, 0.05))):
        there = seen(turned(situation, heading, shift))
        for one, other in ((here.near, there.near), (here.wide, there.wide)):
            assert (np.abs(one.astype(float) - other) < 0.1).mean() > 0.97


def test_a_mirrored_scene_has_mirrored_patches_and_features(situation):
    flip = np.array([1, -1, 1], np.float32)
    view, mesh = situation.view, situation.mesh
    there = replace(
        situation.heard([]),
        view=view.model_copy(update={"depth": view.depth[::-1].copy()}),
        mesh=mesh.model_copy(update={"vertices": mesh.vertices * flip}),
        candidates=Candidates(situation.candidates.picks * flip, situation.candidates.places * flip),
        goals=situation.goals.model_copy(update={"goals": situation.goals.goals * flip}),
    )
    here, mirror = seen(situation).mirrored, seen(there)
    for one, other in ((here.near, mirror.near), (here.wide, mirror.wide)):
        assert (np.abs(one.astype(float) - other) < 0.1).mean() > 0.97
    names, values = features(there)
    aside = [i for i, name in enumerate(names) if name.count("_") == 2 and name.startswith("height_")]
    assert len(aside) == 4
    same = np.isclose(features(situation.heard([]))[1][:, mirrored(names)], values, atol=0.02)
    assert same[:, aside].mean() > 0.8


def test_a_mirror_of_a_mirror_is_the_same(situation):
    names, _ = features(situation)
    assert (mirrored(names)[mirrored(names)] == np.arange(len(names))).all()
    twice = seen(situation).mirrored.mirrored
    np.testing.assert_array_equal(twice.wide, seen(situation).wide)


def test_a_glance_says_the_same_of_a_pull_and_its_mirror_image(situation):
    names, values = features(situation.heard([]))
    torch.manual_seed(0)
    network, patches = GlanceNet(len(names)).eval(), seen(situation)
    said = promised(network.words(patches, names, values))
    mirror = promised(network.words(patches.mirrored, names, values[:, mirrored(names)]))
    np.testing.assert_allclose(mirror, said, atol=1e-6)
    assert said.std() > 0


def test_of_pulls_with_the_same_mean_the_one_all_agree_on_is_promised_more():
    agreed, disputed = np.full((6, 1, 2), 0.05, np.float32), np.full((6, 1, 2), 0.05, np.float32)
    disputed[::2] += 0.04
    disputed[1::2] -= 0.04
    words = np.concatenate([agreed, disputed], axis=1)
    np.testing.assert_allclose(promised(words), [[0.05, 0.05], [0.01, 0.01]], atol=1e-6)


def test_the_network_overfits_one_batch(situation):
    gains = np.random.default_rng(0).normal(size=(COUNT, 2)) * [0.05, 0.008]
    some = sights(seen(situation), situation, gains)
    torch.manual_seed(0)
    network = GlanceNet(len(some.lessons.names))
    for part in network.modules():
        if isinstance(part, torch.nn.Dropout):
            part.p = 0.0
    network.mean.copy_(torch.from_numpy(some.lessons.values.mean(axis=0)))
    network.scale.copy_(torch.from_numpy(some.lessons.values.std(axis=0) + 1e-6))
    task, optimizer = GlanceTask(network, some, some, batch=32, seed=0), torch.optim.Adam(network.parameters(), 2e-3)
    losses = []
    for step in range(150):
        loss = task.loss(step)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert np.mean(losses[-10:]) < 0.1 * losses[0]


def test_a_glance_is_taught_from_what_was_collected_and_loads(situation, tmp_path):
    with pytest.raises(SystemExit, match=r"medor_planner\.judge\.collect"):
        train(Options((tmp_path,), tmp_path / "run"))
    collected(situation, tmp_path)
    train(Options((tmp_path,), tmp_path / "run", epochs=2, batch=4))
    (tmp_path / "run/best").rename(tmp_path / FOLDER)
    config = json.loads((tmp_path / FOLDER / "config.json").read_text())
    assert (config["data"]["states"], config["data"]["pulls"]) == (2, 2 * COUNT)
    assert set(config["data"]["held_out"]) < {7, 8}
    assert Glance.load(tmp_path).gains(situation).shape == (COUNT, 2)


def test_more_lessons_can_be_blended_with_what_was_known(situation, tmp_path):
    """The weights left are the mean of those begun with and those learnt since, and the card says so."""
    collected(situation, tmp_path)
    first, then = tmp_path / "first", tmp_path / "then"
    train(Options((tmp_path,), first, epochs=1, batch=4))
    train(Options((tmp_path,), then, epochs=1, batch=4, lr=0.01, start=first / "best", keep=0.5))
    one, two, mean = (load_file(it / "weights.safetensors") for it in (first / "best", then / "best", then / "blended"))
    name = "members.0.head.1.weight"
    assert not torch.allclose(one[name], two[name])
    torch.testing.assert_close(mean[name], (one[name] + two[name]) / 2)
    assert json.loads((then / "blended/config.json").read_text())["kept of the start"] == 0.5
    with pytest.raises(SystemExit, match="--start"):
        train(Options((tmp_path,), tmp_path / "none", keep=0.5))


def test_what_the_shipped_glance_says_does_not_depend_on_how_many_it_is_asked_about(situation):
    glance, some = Glance.load(), np.arange(COUNT) % 3 == 0
    every = glance.gains(situation)
    np.testing.assert_allclose(glance.gains(situation.among(some)), every[some], atol=1e-4)
    assert (np.abs(every) < [1, 0.1]).all()


def test_without_weights_the_command_that_makes_them_is_named(tmp_path: Path):
    with pytest.raises(BadRequest, match=r"medor_planner\.judge\.train_glance"):
        Glance.load(tmp_path)


def test_the_maps_are_as_many_as_their_names(situation):
    patches = seen(situation)
    assert patches.near.shape == (COUNT, len(NEAR), NEAR_CELLS, NEAR_CELLS)
    assert patches.wide.shape == (COUNT, len(WIDE), WIDE_CELLS, WIDE_CELLS)
