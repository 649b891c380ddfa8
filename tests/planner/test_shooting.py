"""How one plan's candidates are shared: every dynamics instance here takes a given time for a candidate."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from medor_planner.shooting import Shooting
from medor_wire import endpoints, examples
from medor_wire.bus import Call
from medor_wire.errors import BadRequest, Unavailable
from medor_wire.local_bus import LocalBus
from medor_wire.messages import Reward, RolloutProgress, RolloutRequest, Rollouts

CHUNK = 4


@dataclass
class Instance:
    """Rewards every candidate with the x of its pick."""

    seconds: float
    asked: list[int] = field(default_factory=list)
    """Candidates of each request."""

    def roll_out(self, request: RolloutRequest, call: Call) -> Rollouts:
        count = len(request.picks)
        self.asked.append(count)
        for done in range(1, count + 1):
            until = time.monotonic() + self.seconds
            while (left := until - time.monotonic()) > 0:
                call.check()
                time.sleep(min(left, 0.005))
            call.progress(RolloutProgress(done=done, total=count))
        positions = np.zeros((count, len(request.mesh.vertices), 3), np.float32)
        return Rollouts(positions=positions, rewards=request.picks[:, 0].astype(np.float64), seconds=0)


class Crew:
    """Instances on one bus."""

    def __init__(self) -> None:
        self.bus = LocalBus("planner")
        self.members: list[LocalBus] = []

    def hire(self, seconds: float) -> Instance:
        instance = Instance(seconds)
        member = self.bus.connect(f"dynamics-{len(self.members)}")
        member.serve(endpoints.ROLLOUT, instance.roll_out)
        self.members.append(member)
        return instance

    def shoot(self, count: int, on_fraction: Callable[[float], None] = lambda share: None) -> np.ndarray:
        return Shooting(self.bus, request_for(count), threading.Event(), CHUNK).rewards(on_fraction)

    def close(self) -> None:
        for member in (self.bus, *self.members):
            member.close()


def request_for(count: int) -> RolloutRequest:
    picks = np.zeros((count, 3), np.float32)
    picks[:, 0] = np.arange(count)
    return RolloutRequest(mesh=examples.mesh(), picks=picks, places=picks, reward=Reward(task="flatten"))


@pytest.fixture
def crew() -> Iterator[Crew]:
    crew = Crew()
    yield crew
    crew.close()


def test_candidates_keep_their_order_whoever_rates_them(crew):
    for seconds in (0.001, 0.003, 0.0):
        crew.hire(seconds)
    np.testing.assert_array_equal(crew.shoot(37), np.arange(37))


def test_a_fast_instance_does_more_than_a_slow_one(crew):
    fast, slow = crew.hire(0.002), crew.hire(0.01)
    crew.shoot(96)
    assert sum(fast.asked) > 2 * sum(slow.asked) > 0


def test_the_last_chunk_of_a_slow_instance_is_not_waited_for(crew):
    crew.hire(0.001)
    slow = crew.hire(2.0)
    start = time.monotonic()
    shares: list[float] = []
    np.testing.assert_array_equal(crew.shoot(24, shares.append), np.arange(24))
    assert slow.asked, "it had its part"
    assert time.monotonic() - start < 1.5
    assert shares == sorted(shares)
    assert shares[-1] <= 1


def test_a_single_instance_does_everything_once(crew):
    alone = crew.hire(0.0)
    crew.shoot(26)
    assert alone.asked == [4, 4, 4, 4, 4, 4, 2]


def test_a_lost_instance_costs_its_share_only(crew):
    """What the others had done is not done again: beside the lost chunk only the end may be done twice."""
    stays, goes = crew.hire(0.002), crew.hire(0.002)
    leaving: list[threading.Thread] = []

    def lose_one(share: float) -> None:
        if share > 0.4 and not leaving:
            leaving.append(threading.Thread(target=crew.members[1].close))
            leaving[0].start()

    np.testing.assert_array_equal(crew.shoot(80, lose_one), np.arange(80))
    leaving[0].join()
    assert sum(stays.asked) + sum(goes.asked) <= 80 + 2 * CHUNK
    assert sum(goes.asked) > CHUNK


def test_an_instance_that_comes_during_a_plan_takes_part(crew):
    crew.hire(0.005)
    late: list[Instance] = []

    def hire(share: float) -> None:
        if not late:
            late.append(crew.hire(0.005))

    crew.shoot(60, hire)
    assert len(late[0].asked) > 2


def test_what_an_instance_refuses_ends_the_plan(crew):
    def refuse(request: RolloutRequest, call: Call) -> Rollouts:
        raise BadRequest("no such cloth")

    member = crew.bus.connect("dynamics-refusing")
    crew.members.append(member)
    member.serve(endpoints.ROLLOUT, refuse)
    with pytest.raises(BadRequest, match="no such cloth"):
        crew.shoot(8)


def test_without_instances_nothing_is_rated(crew):
    with pytest.raises(Unavailable, match="no dynamics instance"):
        crew.shoot(8)
