from dataclasses import replace

import pytest

from medor_cloth.dataset import Dataset
from medor_sim.collect.collector import collect
from medor_sim.collect.plan import Plan
from medor_sim.collect.scene import Scene
from medor_sim.collect.shard import Shard

RECON = Plan("recon", "skirt", n=3, per_garment=2, edge_m=0.03, winding=12)
DYNAMICS = replace(RECON, kind="dynamics", winding=0)


def collected(shard: Shard) -> Dataset:
    """The shard, filled in this process."""
    with shard.opened():
        list(collect(shard, shard.garments))
    return Dataset(shard.path)


@pytest.fixture(scope="session")
def scene():
    return Scene.of(RECON.make_garment(0))


@pytest.fixture(scope="session")
def recon_data(tmp_path_factory):
    return collected(Shard(RECON, 0, 1, tmp_path_factory.mktemp("recon")))


@pytest.fixture(scope="session")
def dynamics_data(tmp_path_factory):
    return collected(Shard(DYNAMICS, 0, 1, tmp_path_factory.mktemp("dynamics")))
