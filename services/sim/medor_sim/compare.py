"""The cell's two engines beside each other: `python -m medor_sim.compare`.

Drops one garment with each engine, pulls at it, and prints what that costs and how the cloth fares. CPU seconds.
"""

import time
from dataclasses import dataclass

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console

from medor_cloth.coverage import coverage
from medor_cloth.engine import Engine
from medor_cloth.errors import ClothError
from medor_cloth.garment import Garment, generate
from medor_cloth.integration import FRAME_S
from medor_cloth.intersection import self_intersections
from medor_cloth.start import random_pick
from medor_sim.scene import Scene
from medor_sim.wardrobe import EDGE_M, EngineName, Piece
from medor_wire.messages import Category


@dataclass(frozen=True)
class Options:
    """What to compare on."""

    category: Category = "tshirt"
    seed: int = 800001
    """Of the garment."""
    picks: int = 2


def main(options: Options) -> None:
    """Prints one line per engine, pull and state, on the same mesh: the coarse one; then how many times as fast."""
    garment = generate(options.category, options.seed, EDGE_M["bullet"])
    names: tuple[EngineName, ...] = ("xpbd", "bullet")
    ours, theirs = (run(name, garment, options) for name in names)
    if ours and theirs:
        say(f"{names[0]} simulates {np.mean(ours) / np.mean(theirs):.0f} times as much in a CPU second as {names[1]}")


def run(name: EngineName, garment: Garment, options: Options) -> list[float]:
    """Simulated seconds per CPU second of each pick, up to one that the engine does not survive."""
    piece = Piece(name, options.category, garment, name)
    piece.engine.advance(piece.flat, 1)  # compiled
    begin = time.process_time()
    scene = Scene.begin(piece, "drop", 0)
    spent = time.process_time() - begin
    say(f"{name:6} {len(garment.vertices)} vertices, drop {spent:.1f} CPU-s: {shape(scene)}")
    rng, speeds = np.random.default_rng(0), []
    for _ in range(options.picks):
        pick, place = random_pick(scene.cloth.positions, rng)
        begin, before = time.process_time(), scene
        try:
            scene = scene.pulled(pick, place, lambda: None).scene
        except ClothError as error:
            say(f"{name:6} {error}")
            break
        spent, frames = time.process_time() - begin, scene.cloth.frame - before.cloth.frame
        speeds.append(frames * FRAME_S / spent)
        say(f"{name:6} pick {spent:.1f} CPU-s, {speeds[-1]:.2f} simulated s per CPU-s: {shape(scene)}")
    return speeds


def say(line: str) -> None:
    Console().print(line, highlight=False, soft_wrap=True)


def shape(scene: Scene) -> str:
    """How the cloth fares, in words."""
    positions, piece = scene.cloth.positions, scene.piece
    strain = np.abs(strains(piece.engine, positions))
    return (
        f"covers {coverage(positions, piece.garment.faces) / piece.flat_coverage:.2f} of flat, "
        f"edges within {np.percentile(strain, 95):.1%} p95 and {np.percentile(strain, 99):.1%} p99, "
        f"{self_intersections(positions, piece.garment.faces)} crossing faces, "
        f"heights {1000 * positions[:, 2].min():.1f} to {1000 * positions[:, 2].max():.0f} mm, "
        f"median speed {100 * np.median(np.linalg.norm(scene.cloth.velocities, axis=1)):.1f} cm/s"
    )


def strains(engine: Engine, positions: NDArray[np.float32]) -> NDArray[np.float64]:
    """Strain of each edge (E,)."""
    ends = positions[engine.cloth.edges]
    return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) / engine.cloth.rest_lengths - 1


if __name__ == "__main__":
    main(tyro.cli(Options))
