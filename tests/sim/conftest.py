"""A simulated cell without a bus."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from medor_sim.simulator import Simulator
from medor_sim.wardrobe import Wardrobe
from medor_sim.world import World
from medor_wire.bus import Call
from medor_wire.lease import Lessor
from medor_wire.ledger import Ledger
from medor_wire.messages import ActOutcome, ActRequest, Empty, Executor, LeaseRequest, ResetRequest, Score
from medor_wire.motion import Motion

CATEGORY, SEED = "skirt", 800001


@dataclass
class Bench:
    """A simulator and what a test wants of it in one word each."""

    simulator: Simulator
    lessor: Lessor
    told: list[tuple[str, object]] = field(default_factory=list)

    def reset(self, state="flat", seed=0, **garment) -> Score:
        request = {"category": CATEGORY, "garment_seed": SEED, "state": state, "seed": seed} | garment
        return self.simulator.reset(ResetRequest.model_validate(request), Call())

    def score(self) -> Score:
        return self.simulator.score(Empty(), Call())

    def positions(self) -> np.ndarray:
        return self.simulator.truth(Empty(), Call()).mesh.vertices

    def act(self, action_id: str, pick, place, call: Call | None = None, executor: Executor = "picker") -> ActOutcome:
        epoch = self.lessor.lease(LeaseRequest(holder="test/1"), Call()).epoch
        request = ActRequest(
            action_id=action_id, epoch=epoch, pick=np.asarray(pick), place=np.asarray(place), executor=executor
        )
        return self.simulator.act(request, call or Call())


@pytest.fixture(scope="session")
def wardrobe() -> Wardrobe:
    return Wardrobe()


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    world = World()
    yield world
    world.close()


@pytest.fixture
def bench(tmp_path: Path, wardrobe: Wardrobe) -> Iterator[Bench]:
    with closing(Ledger(tmp_path / "ledger.sqlite")) as ledger:
        lessor = Lessor(ledger, ttl_s=60)  # nobody renews it here
        told: list[tuple[str, object]] = []
        motion = Motion(ledger, lessor)
        with closing(Simulator(motion, wardrobe, lambda topic, message: told.append((topic.name, message)))) as cell:
            yield Bench(cell, lessor, told)
