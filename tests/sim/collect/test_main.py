import sys

import numpy as np
import pytest
import trimesh
from PIL import Image

from medor_sim.collect.__main__ import main, parse_shard

from .conftest import RECON


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["collect", *map(str, words)])
    main()


def test_collecting_from_the_command_line_writes_shard_and_preview(monkeypatch, tmp_path, capsys):
    words = ["dynamics", "--category", "skirt", "--n", 1, "--edge-m", 0.03, "--out", tmp_path, "--workers", 1]
    run(monkeypatch, *words, "--shard", "0/1", "--preview")
    assert "1/1 trajectories" in capsys.readouterr().err
    with Image.open(tmp_path / "dynamics" / "skirt" / "shard-0000-of-0001.png") as preview:
        assert np.asarray(preview).std() > 5
    run(monkeypatch, *words)
    assert "1/1 trajectories, 0/h" in capsys.readouterr().err, "nothing left to do"


def test_export_npz_holds_everything(monkeypatch, tmp_path, recon_data):
    run(monkeypatch, "export", recon_data.folder, "--out", tmp_path, "--count", 1)
    with np.load(tmp_path / "skirt-000000.npz") as file:
        np.testing.assert_array_equal(file["nocs"], recon_data[0]["nocs"])
        assert file["garment_seed"] == recon_data[0].garment.seed
        assert {"depth", "mask", "positions", "faces", "vertices"} <= set(file.files)


def test_export_ply_holds_the_posed_mesh(monkeypatch, tmp_path, recon_data):
    run(monkeypatch, "export", recon_data.folder, "--out", tmp_path, "--format", "ply", "--count", 1)
    files = sorted(tmp_path.glob("*.ply"))
    mesh = trimesh.load_mesh(files[2], process=False)
    assert len(files) == 5
    np.testing.assert_allclose(mesh.vertices, recon_data[0]["positions"][2], atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, recon_data[0].garment["faces"])


@pytest.mark.parametrize("text", ["1", "3/3", "a/b", "-1/2"])
def test_a_shard_is_i_of_n(text):
    with pytest.raises(ValueError, match="i/N"):
        parse_shard(text)
    assert parse_shard("2/3") == (2, 3)
    assert RECON.shard(2, 3) == range(2, 2, 3)
