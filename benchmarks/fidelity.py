"""How well the cloth behaves like cloth: `python -m benchmarks.fidelity`.

Folds that stay and open, a pull that unfolds, rest, and what the step size and the mesh change. Prints
one table a question and writes a picture of each; the same figures are asserted in `tests/cloth/test_fidelity.py`.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from medor_cloth.camera import overhead
from medor_cloth.coverage import coverage
from medor_cloth.film import film, png_sheet_bytes
from medor_cloth.garment import CATEGORIES, Garment, generate
from medor_cloth.goals import flattened, solver_of
from medor_cloth.intersection import self_intersections
from medor_cloth.picker import pick_place
from medor_cloth.solver import ClothState, Solver
from medor_cloth.start import dropped, picked

FOLD_M = 0.12
"""The crease of a corner fold cuts this much off both sides of a square corner."""
PULL_M = 0.15
CARRY_FRAMES = 70
REST_FRAMES = 200
SEEDS = {"tshirt": (800004, 800005, 800006), "trousers": (800123, 800124, 800125), "skirt": (800009, 800010, 800012)}
_DIAGONAL = np.array([1, 1, 0]) / np.sqrt(2)


class Flat:
    """A flattened garment and what moves it."""

    def __init__(self, category: str, seed: int, vertices: int | None = None) -> None:
        self.garment: Garment = generate(category, seed)
        if vertices:
            edge = 0.012 * float(np.sqrt(len(self.garment.vertices) / vertices))
            self.garment = generate(category, seed, edge)
        self.solver = solver_of(self.garment)
        self.state = flattened(self.garment, self.solver)
        self.area = self.covered(self.state)

    def covered(self, state: ClothState | NDArray) -> float:
        """Covered area [m²]."""
        positions = state.positions if isinstance(state, ClothState) else state
        return coverage(positions, self.garment.faces)


@dataclass(frozen=True)
class Fold:
    """What became of a fold.

    Attributes:
        kept: Area it hides after two seconds at rest, as a share of what an ideal fold hides.
        restored: Area covered after the inverse picks, as a share of the flat area.
        states: Folded and opened.
    """

    kept: float
    restored: float
    states: tuple[ClothState, ClothState]


def fold_corner(flat: Flat) -> tuple[ClothState, int, float]:
    """A corner carried inwards; the state two seconds later, the corner's vertex, and the share of the ideal hidden."""
    positions = flat.state.positions
    corner = int((positions[:, :2] @ (0.8, 1.0)).argmin())
    way = np.array([FOLD_M, FOLD_M, 0])
    mirrored = positions.copy()
    depth = (mirrored - positions[corner] - way / 2) @ _DIAGONAL
    mirrored[depth < 0] -= 2 * depth[depth < 0, None] * _DIAGONAL.astype(np.float32)
    folded = carry(flat.solver, flat.state, corner, positions[corner] + way + [0, 0, 0.015])
    folded = flat.solver.advance(folded, REST_FRAMES)
    return folded, corner, (flat.area - flat.covered(folded)) / (flat.area - flat.covered(mirrored))


def corner_fold(flat: Flat) -> Fold:
    """A 12 cm corner fold, and its inverse pick from where the vertex is then."""
    folded, corner, kept = fold_corner(flat)
    opened = carry(flat.solver, folded, corner, flat.state.positions[corner])
    return Fold(kept, flat.covered(opened) / flat.area, (folded, opened))


def half_fold(flat: Flat, picks: int = 4) -> Fold:
    """A garment laid in half about its body axis, and picks that carry back what is farthest from its place."""
    positions = flat.state.positions
    middle, over = np.median(positions[:, 0]), positions[:, 2].max() + flat.solver.config.thickness / 2
    half = positions.copy()
    turned = half[:, 0] > middle
    half[turned, 0] = 2 * middle - half[turned, 0]
    half[turned, 2] = 2 * over - half[turned, 2]
    folded = flat.solver.advance(flat.solver.rest(half), REST_FRAMES)
    opened = folded
    for _ in range(picks):
        astray = int(np.linalg.norm((opened.positions - positions)[:, :2], axis=1).argmax())
        opened = carry(flat.solver, opened, astray, positions[astray])
    kept = (flat.area - flat.covered(folded)) / (flat.area - flat.covered(half))
    return Fold(kept, flat.covered(opened) / flat.area, (folded, opened))


@dataclass(frozen=True)
class Pull:
    """What an outward pull at a folded corner did.

    Attributes:
        unfolded: Share of the hidden area that it uncovered.
        dragged_m: Way of the middle of the rest of the garment, beyond the fold.
        state: After it.
    """

    unfolded: float
    dragged_m: float
    state: ClothState


def corner_pull(flat: Flat, friction: bool = True) -> Pull:
    """A pull of 15 cm outwards at a corner that was folded in; without friction as an option."""
    folded, corner, _ = fold_corner(flat)
    config = flat.solver.config
    slippery = replace(config, table_friction=0.0, layer_friction=0.0)
    solver = Solver(flat.solver.cloth, config if friction else slippery)
    pick = folded.positions[corner] + [0, 0, 0.01]
    after = pick_place(solver, folded, pick, pick - PULL_M * _DIAGONAL + [0, 0, 0.03]).state
    positions = flat.state.positions
    beyond = (positions - positions[corner]) @ _DIAGONAL > FOLD_M * np.sqrt(2)
    way = (after.positions - folded.positions)[beyond, :2].mean(axis=0)
    hidden = flat.area - flat.covered(folded)
    return Pull((flat.covered(after) - flat.covered(folded)) / hidden, float(np.linalg.norm(way)), after)


@dataclass(frozen=True)
class Rest:
    """A garment at rest after a drop and five picks, and held in a pull.

    Attributes:
        drift_m_s: 99th percentile of the vertices' speed over 0.1 s.
        tremble_m_s: 99th percentile of their speed from one substep to the next.
        stretched, compressed, held: 95th percentile of the edges' strain: lengthened at rest, shortened at rest, either
            while held.
        crossings: Crossing pairs of faces per 100 edges.
        state: At rest.
    """

    drift_m_s: float
    tremble_m_s: float
    stretched: float
    compressed: float
    held: float
    crossings: float
    state: ClothState


def rest(flat: Flat, seed: int) -> Rest:
    """A drop, five random picks, a second of rest."""
    rng, solver = np.random.default_rng(seed), flat.solver
    state = solver.advance(picked(solver, dropped(solver, flat.state, rng), rng), 100)
    later = solver.advance(state, 10)
    way = np.linalg.norm(later.positions - state.positions, axis=1)
    strain = edge_strain(solver, later.positions)
    top = later.positions[later.positions[:, 2].argmax()] + [0, 0, 0.01]
    pulled = pick_place(solver, later, top, top + [0.1, 0.05, 0.08], record_every=10).frames[:5]
    return Rest(
        drift_m_s=float(np.percentile(way, 99)) / 0.1,
        tremble_m_s=float(np.percentile(np.linalg.norm(later.velocities, axis=1), 99)),
        stretched=float(np.percentile(np.maximum(strain, 0), 95)),
        compressed=float(np.percentile(np.maximum(-strain, 0), 95)),
        held=max(float(np.percentile(np.abs(edge_strain(solver, frame)), 95)) for frame in pulled),
        crossings=100 * self_intersections(later.positions, flat.garment.faces) / len(solver.cloth.edges),
        state=later,
    )


def settled_coverage(flat: Flat, seed: int, substeps: int | None = None) -> float:
    """Coverage after a lift and a drop, as a share of the flat one; with another number of substeps if given."""
    solver = flat.solver
    if substeps:
        solver = Solver(solver.cloth, replace(solver.config, substeps=substeps))
    state = dropped(solver, flat.state, np.random.default_rng(seed), max_coverage=1.0)
    return flat.covered(state) / flat.area


def carry(solver: Solver, state: ClothState, vertex: int, target: NDArray) -> ClothState:
    """A vertex carried over an arc to a place on the table and let go there; at rest after two seconds."""
    start = state.positions[vertex]
    u = np.linspace(0, 1, CARRY_FRAMES + 1)[1:, None]
    u = u * u * (3 - 2 * u)
    path = start + u * (target - start)
    path[:, 2] += 0.5 * np.linalg.norm(target - start) * np.sin(np.pi * u[:, 0])
    state = solver.placed(state, start)
    state = solver.advance(state, CARRY_FRAMES, picker_path=path, holding=np.ones(CARRY_FRAMES, bool))
    return solver.advance(state, REST_FRAMES, settle_speed=0.02)


def edge_strain(solver: Solver, positions: NDArray) -> NDArray[np.float64]:
    """Relative change of length of every edge (E,)."""
    ends = positions[solver.cloth.edges].astype(np.float64)
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / solver.cloth.rest_lengths - 1


@dataclass(frozen=True)
class Options:
    """What to measure."""

    drops: int = 10
    """Drops for what step and mesh change; 0 leaves that out."""
    out: Path = Path("runs/fidelity")
    """Where the pictures go."""


def main(options: Options) -> None:
    """Prints the tables."""
    options.out.mkdir(parents=True, exist_ok=True)
    print(
        "| garment | corner fold: kept | restored | in half: kept | restored | corner pull: unfolded, dragged |", end=""
    )
    print(" without friction |\n|---|---|---|---|---|---|---|")
    for category, seeds in SEEDS.items():
        for seed in seeds:
            flat = Flat(category, seed)
            corner, half = corner_fold(flat), half_fold(flat)
            pull, slide = corner_pull(flat), corner_pull(flat, friction=False)
            print(
                f"| {category} {seed} | {corner.kept:.2f} | {corner.restored:.3f} | {half.kept:.2f} "
                f"| {half.restored:.3f} | {pull.unfolded:.2f}, {100 * pull.dragged_m:.1f} cm "
                f"| {slide.unfolded:.2f}, {100 * slide.dragged_m:.1f} cm |",
                flush=True,
            )
            states = [flat.state, *corner.states, pull.state, slide.state, *half.states]
            _picture(options.out / f"folds-{category}-{seed}.png", flat, states)
    print("\n| at rest | drift | tremble | stretched | compressed | held | crossings / 100 edges |")
    print("|---|---|---|---|---|---|---|")
    for category in CATEGORIES:
        flat = Flat(category, 800001)
        found = rest(flat, 0)
        print(
            f"| {category} | {100 * found.drift_m_s:.2f} cm/s | {100 * found.tremble_m_s:.1f} cm/s "
            f"| {found.stretched:.1%} | {found.compressed:.1%} | {found.held:.1%} | {found.crossings:.2f} |",
            flush=True,
        )
        _picture(options.out / f"rest-{category}.png", flat, [found.state])
    if options.drops:
        convergence(options.drops)


def convergence(drops: int) -> None:
    """Prints mean coverage over drops at half the step and on other meshes."""
    for category in ("tshirt", "trousers"):
        flat, coarse, fine = Flat(category, 800010), Flat(category, 800010, 700), Flat(category, 800010, 1500)
        rows = {
            "12 substeps": [settled_coverage(flat, seed) for seed in range(drops)],
            "24 substeps": [settled_coverage(flat, seed, 24) for seed in range(drops)],
            "700 vertices": [settled_coverage(coarse, seed) for seed in range(drops)],
            "1500 vertices": [settled_coverage(fine, seed) for seed in range(drops)],
        }
        for name, shares in rows.items():
            error = np.std(shares) / np.sqrt(drops)
            print(f"{category}, {name}: coverage {np.mean(shares):.3f} ± {error:.3f} of flat over {drops} drops")


def _picture(path: Path, flat: Flat, states: list[ClothState]) -> None:
    path.write_bytes(png_sheet_bytes(film([state.positions for state in states], flat.garment.faces, overhead(360))))


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
