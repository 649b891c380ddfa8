from dataclasses import replace

import pytest

from medor_cloth.dataset import SPLITS

from .conftest import RECON

BIG = replace(RECON, n=103, per_garment=10)


@pytest.mark.parametrize("count", [1, 3, 20])
def test_shards_share_out_every_trajectory_once(count):
    ids = [i for k in range(count) for garment in BIG.shard(k, count) for i in BIG.trajectories(garment)]
    assert sorted(ids) == list(range(103))


@pytest.mark.parametrize("split", SPLITS)
def test_garments_are_of_their_split_and_repeat(split):
    plan = replace(BIG, split=split)
    seeds = [plan.make_garment(k).seed for k in range(3)]
    assert all(seed in SPLITS[split] for seed in seeds)
    assert len(set(seeds)) == 3
    assert seeds == [plan.make_garment(k).seed for k in range(3)]


def test_every_trajectory_attempt_and_seed_has_its_own_chance():
    streams = [
        BIG.trajectory_rng(1, 0),
        BIG.trajectory_rng(2, 0),
        BIG.trajectory_rng(1, 1),
        BIG.start_rng(1, 0),
        replace(BIG, seed=7).trajectory_rng(1, 0),
        replace(BIG, kind="dynamics").trajectory_rng(1, 0),
    ]
    assert len({rng.random() for rng in streams}) == len(streams)
    assert BIG.trajectory_rng(5, 2).random() == BIG.trajectory_rng(5, 2).random()
