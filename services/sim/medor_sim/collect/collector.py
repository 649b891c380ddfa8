"""Fills a shard: every trajectory of every garment that is not there yet."""

from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from medor_cloth.errors import ClothError
from medor_cloth.solver import ClothState
from medor_sim.collect import dynamics, recon
from medor_sim.collect.plan import Plan
from medor_sim.collect.scene import Scene
from medor_sim.collect.shard import Shard, append

MAX_ATTEMPTS = 50
"""Something discarded this often means that something is wrong."""
T = TypeVar("T")


def collect(shard: Shard, garments: Iterable[int]) -> Iterator[int]:
    """Writes the missing trajectories of some garments of an opened shard.

    Yields:
        The id of each trajectory once it is on disk.
    """
    for garment in garments:
        record = shard.record(garment)
        if record is None:
            scene = Scene.of(shard.plan.make_garment(garment))
            record = shard.add(garment, scene)
        elif record.complete.all():
            continue
        else:
            scene = Scene.stored(record)
        make = maker(shard.plan, scene)
        for row in np.flatnonzero(~record.complete):
            number = shard.plan.trajectories(garment)[row]
            append(record, int(row), make(number))
            yield number


def maker(plan: Plan, scene: Scene) -> Callable[[int], dict[str, NDArray]]:
    """What makes the arrays of a trajectory from its id; they depend on plan, garment and id alone."""
    if plan.kind == "recon":
        return lambda number: _kept(partial(recon.trajectory, scene), partial(plan.trajectory_rng, number))

    @lru_cache(maxsize=1)
    def start(number: int) -> ClothState:
        return _kept(partial(dynamics.start, scene), partial(plan.start_rng, number))

    def pull(number: int) -> dict[str, NDArray]:
        draw = partial(dynamics.trajectory, scene, start(number // dynamics.PER_START))
        return _kept(draw, partial(plan.trajectory_rng, number))

    return pull


def _kept(draw: Callable[[np.random.Generator], T | None], rng: Callable[[int], np.random.Generator]) -> T:
    """The first draw that is not discarded; attempt k has the k-th stream of chance."""
    for attempt in range(MAX_ATTEMPTS):
        try:
            drawn = draw(rng(attempt))
        except ClothError:  # no drop crumpled enough, no pick that keeps the cloth in view: as good as discarded
            continue
        if drawn is not None:
            return drawn
    raise ClothError(f"discarded {MAX_ATTEMPTS} times in a row")
