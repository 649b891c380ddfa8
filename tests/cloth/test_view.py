from itertools import pairwise

import numpy as np
import pytest
import trimesh
from PIL import Image, ImageSequence

from medor_cloth.view import TURN_FRAMES, main

from .sheets import sheet

VERTICES, FACES = sheet(6, 4)


@pytest.fixture(scope="module")
def rollout(tmp_path_factory):
    path = tmp_path_factory.mktemp("states") / "rollout.npz"
    lifted = [VERTICES + np.array([0.01 * k, 0, 0.01 * k], np.float32) for k in range(5)]
    np.savez(path, positions=np.stack(lifted), faces=FACES)
    return path


def show(*words):
    main([str(word) for word in words])


def frames(path):
    with Image.open(path) as gif:
        return [np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(gif)]


def test_a_rollout_plays_state_by_state_and_moves(rollout, tmp_path, capsys):
    show(rollout, "--out", tmp_path / "new" / "a.gif", "--width", 64)
    shown = frames(tmp_path / "new" / "a.gif")
    assert len(shown) == 5
    assert shown[0].shape == (64, 128, 3), "from above and from the side"
    assert all(np.abs(one - other).max() > 50 for one, other in pairwise(shown))
    assert "5 states, 35 vertices" in capsys.readouterr().err


def test_a_picture_holds_all_states_row_by_row(rollout, tmp_path):
    show(rollout, "--out", tmp_path / "a.png", "--width", 48, "--view", "top")
    with Image.open(tmp_path / "a.png") as sheet:
        assert sheet.size == (3 * 48, 2 * 48)


def test_a_single_mesh_is_turned_about(tmp_path):
    ball = trimesh.creation.box((0.1, 0.2, 0.3))
    ball.export(tmp_path / "box.ply")
    show(tmp_path / "box.ply", "--out", tmp_path / "turn.gif", "--width", 48)
    shown = frames(tmp_path / "turn.gif")
    assert len(shown) == TURN_FRAMES
    half = shown[TURN_FRAMES // 2]
    assert np.abs(shown[TURN_FRAMES // 4] - shown[0]).mean() > 2 * np.abs(half - shown[0]).mean(), (
        "a box, twice the same"
    )


def test_without_a_name_the_file_is_called_after_what_it_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    show("--category", "skirt", "--seed", 3, "--edge-m", 0.03, "--width", 32)
    with Image.open("skirt-3-worn.png") as picture:
        assert picture.size == (32, 32), "a worn garment is seen from the side"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "nothing to show"),
        (["--category", "skirt"], "nothing to show"),
        (["nowhere.obj"], "does not exist"),
        (["{rollout}", "--out", "x.jpg"], "ending in .gif or .png"),
        (["{rollout}", "--out", "{rollout}/x.png"], "cannot write"),
        (["--category", "skirt", "--seed", "1", "--edge-m", "0.5"], "edge_m must lie in"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(rollout, words, complaint):
    with pytest.raises(SystemExit, match=complaint) as ended:
        show(*(word.format(rollout=rollout) for word in words))
    assert str(ended.value).startswith("medor view: ")
