import pytest

from medor_sim.world import World


@pytest.fixture(scope="module")
def world():
    world = World()
    yield world
    world.close()
