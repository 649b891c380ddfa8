"""How fast the cloth solver is: `python -m benchmarks.solver`.

Times pick-and-places from crumpled starts on garments held out from training, and their scaling over threads. CPU
seconds; run it on an idle machine. Beside PyBullet's soft body: `python -m medor_sim.compare`.
"""

import os
import time
from dataclasses import dataclass

import numpy as np
import tyro
from numpy.typing import NDArray

from medor_cloth.garment import CATEGORIES, Garment, generate
from medor_cloth.goals import flattened, solver_of
from medor_cloth.intersection import self_intersections
from medor_cloth.rollout import rollouts
from medor_cloth.solver import ClothState, Solver
from medor_cloth.start import dropped, random_pick

FIRST_SEED = 800100
MANY = 500
"""Candidates of one decision of the planner."""


@dataclass(frozen=True)
class Options:
    """What to time."""

    candidates: int = 12
    """Pick-and-places per garment."""
    vertices: int = 750
    """Size of the garments the candidates are rolled out on."""


def main(options: Options) -> None:
    """Prints the measurements."""
    for category in CATEGORIES:
        garment = of_size(category, options.vertices)
        solver, state = crumpled(garment)
        seconds, crossings = candidates(garment, solver, state, options.candidates)
        print(
            f"{category:9} {len(garment.vertices):4} vertices: {seconds.mean():.3f} CPU-s a candidate "
            f"({seconds.min():.3f}–{seconds.max():.3f}), {crossings:.1f} crossing faces after it; "
            f"{MANY} candidates {MANY * seconds.mean():.0f} CPU-s"
        )
    threads(options)


def candidates(garment: Garment, solver: Solver, state: ClothState, n: int) -> tuple[NDArray[np.float64], float]:
    """CPU seconds of n pick-and-places one after the other (n,), and the mean number of crossing faces after them."""
    picks, places = random_picks(state, n)
    seconds, crossings = [], []
    for pick, place in zip(picks, places, strict=True):
        begin = time.process_time()
        after = rollouts(solver, state, pick[None], place[None], threads=1)
        seconds.append(time.process_time() - begin)
        crossings.append(self_intersections(after[0], garment.faces))
    return np.array(seconds), float(np.mean(crossings))


def threads(options: Options) -> None:
    """Prints the time of the same rollouts on one thread and on all."""
    garment = of_size("tshirt", options.vertices)
    solver, state = crumpled(garment)
    picks, places = random_picks(state, 2 * options.candidates)
    wall = {}
    for n in (1, os.cpu_count() or 1):
        begin = time.perf_counter()
        rollouts(solver, state, picks, places, threads=n)
        wall[n] = time.perf_counter() - begin
    (one, alone), (n, together) = min(wall.items()), max(wall.items())
    print(
        f"threads: {len(picks)} candidates take {alone:.1f} s on {one}, {together:.1f} s on {n}: "
        f"{alone / together:.2f} times as fast; {MANY} candidates {MANY * together / len(picks):.0f} s"
    )


def of_size(category: str, vertices: int) -> Garment:
    """Of the first held-out garments the one whose number of vertices is closest."""
    garments = (generate(category, seed) for seed in range(FIRST_SEED, FIRST_SEED + 16))
    return min(garments, key=lambda garment: abs(len(garment.vertices) - vertices))


def crumpled(garment: Garment) -> tuple[Solver, ClothState]:
    """The garment after a lift and a drop; everything compiled."""
    solver = solver_of(garment)
    return solver, dropped(solver, flattened(garment, solver), np.random.default_rng(0))


def random_picks(state: ClothState, n: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Picks and places (n,3) [m]."""
    rng = np.random.default_rng(1)
    picks, places = zip(*(random_pick(state.positions, rng) for _ in range(n)), strict=True)
    return np.stack(picks), np.stack(places)


if __name__ == "__main__":
    main(tyro.cli(Options))
