import errno
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
import zarr

from medor_cloth.dataset import SPLITS, Dataset
from medor_cloth.errors import DatasetError
from medor_cloth.winding import winding_grid
from medor_sim.collect import shard as shard_module
from medor_sim.collect.collector import collect
from medor_sim.collect.shard import Shard
from medor_sim.collect.workers import collect_in_processes

from .conftest import DYNAMICS, RECON, collected


def contents(dataset):
    """Everything a data set holds, by trajectory id, as bytes."""
    names = ("depth", "mask", "nocs", "positions", "moves", "visible", "move", "grasp")
    return {t.id: (t.garment.seed, *(t[name].tobytes() for name in names if name in t.garment.group)) for t in dataset}


@pytest.mark.parametrize("kind", ["recon", "dynamics"])
def test_interrupted_and_resumed_equals_in_one_go_bit_for_bit(kind, tmp_path, recon_data, dynamics_data):
    plan, whole = (RECON, recon_data) if kind == "recon" else (DYNAMICS, dynamics_data)
    shard = Shard(plan, 0, 1, tmp_path)
    for _ in range(plan.n):  # ends after every single trajectory
        with shard.opened():
            next(collect(shard, shard.garments))
    assert contents(Dataset(tmp_path)) == contents(whole)


def test_two_shards_in_two_folders_merge_by_moving_them(tmp_path, recon_data):
    for index in range(2):
        collected(Shard(RECON, index, 2, tmp_path / f"machine{index}"))
    merged = tmp_path / "merged"
    merged.mkdir()
    for index in range(2):
        found = Shard(RECON, index, 2, tmp_path / f"machine{index}").path
        found.rename(merged / f"any-name-{index}.zarr")
    assert contents(Dataset(merged)) == contents(recon_data)


def test_two_workers_write_the_same_data(tmp_path, dynamics_data):
    shard, written = Shard(DYNAMICS, 0, 1, tmp_path), []
    with shard.opened():
        collect_in_processes(shard, shard.garments, 2, written.append)
    assert sorted(written) == [0, 1, 2]
    assert contents(Dataset(tmp_path)) == contents(dynamics_data)


def test_a_full_disk_is_told_and_nothing_written_is_lost(tmp_path, monkeypatch, recon_data):
    shard = Shard(RECON, 0, 1, tmp_path)
    with shard.opened():
        next(collect(shard, shard.garments))
        write = zarr.Array.__setitem__

        def full(array, *arguments):
            if array.name.endswith("positions"):
                raise OSError(errno.ENOSPC, "No space left on device")
            write(array, *arguments)

        monkeypatch.setattr(zarr.Array, "__setitem__", full)
        with pytest.raises(DatasetError, match="disk is full"):
            next(collect(shard, shard.garments))
    monkeypatch.undo()
    assert list(contents(Dataset(tmp_path))) == [0]
    collected(shard)
    assert contents(Dataset(tmp_path)) == contents(recon_data)


def test_a_garment_half_written_is_written_anew(tmp_path, monkeypatch, scene):
    shard = Shard(RECON, 0, 1, tmp_path)
    with shard.opened():
        monkeypatch.setattr(shard_module, "winding_grid", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            shard.add(0, scene)
        monkeypatch.undo()
        assert shard.record(0) is None
    with shard.opened():
        np.testing.assert_array_equal(shard.add(0, scene)["vertices"], scene.garment.vertices)


def test_going_on_with_changed_code_is_recorded(tmp_path, monkeypatch):
    shard = Shard(RECON, 0, 1, tmp_path)
    for revision in ("a", "b", "b"):
        monkeypatch.setattr(shard_module, "git_revision", lambda revision=revision: revision)
        with shard.opened():
            assert zarr.open_group(shard.path, mode="r").attrs["revisions"] == sorted({"a", revision})


def test_a_shard_is_for_one_process_and_one_plan(tmp_path):
    shard = Shard(RECON, 0, 1, tmp_path)
    with shard.opened(), pytest.raises(DatasetError, match="another process"), shard.opened():
        pass
    with pytest.raises(DatasetError, match="another plan"), Shard(replace(RECON, seed=1), 0, 1, tmp_path).opened():
        pass


def test_garments_for_training_and_for_tests_never_mix(tmp_path, recon_data):
    test = replace(RECON, n=1, split="test")
    data = collected(Shard(test, 0, 1, tmp_path / "test"))
    assert all(record.seed in SPLITS["test"] for record in data.garments)
    assert all(record.seed in SPLITS["train"] for record in recon_data.garments)
    shutil.copytree(recon_data.folder, tmp_path / "mixed" / "train.zarr")
    shutil.copytree(Shard(test, 0, 1, tmp_path / "test").path, tmp_path / "mixed" / "test.zarr")
    with pytest.raises(DatasetError, match="test and train"):
        Dataset(tmp_path / "mixed")


def test_a_shard_twice_is_refused(tmp_path, recon_data):
    for name in ("one", "two"):
        shutil.copytree(recon_data.folder, tmp_path / f"{name}.zarr")
    with pytest.raises(DatasetError, match="twice"):
        Dataset(tmp_path)


def test_what_a_garment_stores(recon_data, scene):
    record = recon_data.garments[0]
    np.testing.assert_array_equal(record.garment.vertices, scene.garment.vertices)
    np.testing.assert_array_equal(record["flat"], scene.flat.positions)
    np.testing.assert_array_equal(record["rest_lengths"], scene.solver.cloth.rest_lengths)
    grid = winding_grid(scene.nocs, scene.garment.faces, 12)
    np.testing.assert_allclose(record.winding(12), grid, atol=6e-5)
    np.testing.assert_allclose(record.winding(9), winding_grid(scene.nocs, scene.garment.faces, 9), atol=1e-6)


def test_revision_plan_and_seeds_are_recorded(recon_data):
    attributes = recon_data.shards[0].attrs.asdict()
    assert attributes["plan"]["seed"] == RECON.seed
    (revision,) = attributes["revisions"]
    assert re.fullmatch(r"[0-9a-f]{40}\+?|unknown", revision)
    assert {record.seed for record in recon_data.garments} == {RECON.make_garment(k).seed for k in range(2)}
