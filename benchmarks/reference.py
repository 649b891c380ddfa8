"""Our cloth solver beside a slow reference of another make: `python -m benchmarks.reference`.

The same garments are lifted at the same vertices along the same paths and let go; what the reference leaves of it is
then pulled about by the same picks. Compared is what settles: coverage and the height of the pile. Single outcomes
are chaotic, so means count. The reference (`benchmarks.vbd`, `pip install newton`) takes minutes a case and is asked
once: killed and started again, or run again after a change of our solver, it computes only what is missing. The
cases come in an order that makes the first of every garment done first.
"""

import json
import time
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from medor_cloth.coverage import coverage
from medor_cloth.engine import Engine
from medor_cloth.footage import Footage
from medor_cloth.garment import Garment, generate
from medor_cloth.goals import centred, solver_of
from medor_cloth.picker import SETTLED_SPEED, pick_place
from medor_cloth.picture import png_bytes
from medor_cloth.solver import ClothState
from medor_cloth.start import random_pick
from medor_cloth.view import pictures

GARMENTS = {"tshirt": (800101, 0.014), "trousers": (800101, 0.013), "skirt": (800102, 0.013)}
"""Held-out seed and edge length [m] that give 520 to 590 vertices."""
LIFT_M = (0.25, 0.35)
LIFT_SPEED_M = 0.01
"""Way of a lift in a frame [m]."""
HANG_FRAMES, FALL_FRAMES, SETTLE_FRAMES = 15, 100, 80
WIDTH_PX = 300
MEASURES = ("coverage", "z95", "z_max")


@dataclass(frozen=True)
class Options:
    """What to compare."""

    each: int = 3
    """Drops of each garment, and as many picks."""
    out: Path = Path("runs/reference")
    """Where every case's settled states and figures are kept, and a picture of them."""
    missing: bool = True
    """Ask the reference for what it has not answered yet; else only what it has is compared (newton is not needed)."""


@dataclass(frozen=True)
class Case:
    """One thing that happens to one garment."""

    category: str
    kind: Literal["drop", "pick"]
    number: int

    @property
    def name(self) -> str:
        return f"{self.category}-{self.kind}-{self.number}"

    @property
    def before(self) -> "Case":
        """The drop whose outcome a pick is made on."""
        return replace(self, kind="drop")

    @cached_property
    def garment(self) -> Garment:
        return generate(self.category, *GARMENTS[self.category])

    def play(self, engine: Engine, crumpled: NDArray[np.float32] | None) -> ClothState:
        """What the case leaves, from the garment laid out flat (a drop) or from a crumpled one (V,3) [m] (a pick)."""
        rng = np.random.default_rng([list(GARMENTS).index(self.category), self.number])
        if crumpled is None:
            return _lift_and_drop(engine, centred(self.garment.laid_flat()), rng)
        pick, place = random_pick(crumpled, rng)
        return pick_place(engine, engine.rest(crumpled), pick, place, settle_frames=SETTLE_FRAMES).state


def _lift_and_drop(engine: Engine, flat: NDArray[np.float32], rng: np.random.Generator) -> ClothState:
    """The cloth after a vertex was raised straight up, held for a moment and let go."""
    start = flat[rng.integers(len(flat))]
    frames = int(np.ceil((rng.uniform(*LIFT_M) - start[2]) / LIFT_SPEED_M))
    path = np.repeat(start[None], frames + HANG_FRAMES, 0)
    path[:, 2] += LIFT_SPEED_M * np.minimum(np.arange(1, len(path) + 1), frames)
    state = engine.placed(engine.rest(flat), start)
    state = engine.advance(state, len(path), picker_path=path, holding=np.ones(len(path), bool))
    return engine.advance(state, FALL_FRAMES, settle_speed=SETTLED_SPEED)


class Store:
    """Settled states and figures of every case on disk, by the name of the engine."""

    def __init__(self, folder: Path):
        self._folder = folder

    def states(self, case: Case, engine: str) -> NDArray[np.float32]:
        return np.load(self._folder / engine / f"{case.name}.npy")

    def figures(self, case: Case, engine: str) -> dict[str, Any] | None:
        """None when the case has not been played."""
        path = self._folder / engine / f"{case.name}.json"
        return json.loads(path.read_text()) if path.exists() else None

    def play(self, case: Case, name: str, engine: Engine) -> None:
        """Plays a case and keeps what it left; a pick begins where the reference's drop ended."""
        begin = time.process_time()
        state = case.play(engine, None if case.kind == "drop" else self.states(case.before, "reference"))
        seconds = time.process_time() - begin
        folder = self._folder / name
        folder.mkdir(parents=True, exist_ok=True)
        np.save(folder / f"{case.name}.npy", state.positions)
        figures = measured(state.positions, case.garment.faces) | {"frames": state.frame, "cpu_s": seconds}
        (folder / f"{case.name}.json").write_text(json.dumps(asdict(case) | figures))


def measured(positions: NDArray[np.float32], faces: NDArray[np.int32]) -> dict[str, float]:
    """Coverage [m²], the height 95 % of the vertices lie below and that of the highest [m]."""
    z = positions[:, 2]
    return {
        "coverage": coverage(positions, faces),
        "z95": float(np.percentile(z, 95)),
        "z_max": float(z.max()),
    }


def compare(options: Options, console: Console) -> str:
    """Plays what is missing in the reference and everything in our solver; the figures as a Markdown table."""
    store = Store(options.out)
    cases = [Case(c, k, n) for n in range(options.each) for k in ("drop", "pick") for c in GARMENTS]
    missing = [case for case in cases if store.figures(case, "reference") is None] if options.missing else []
    engines: dict[str, Engine] = {}
    for case in track(missing, "reference", console=console):
        if case.category not in engines:
            engines[case.category] = _reference(case.garment)
        store.play(case, "reference", engines[case.category])
    cases = [case for case in cases if store.figures(case, "reference") is not None]
    for case in track(cases, "ours", console=console):
        store.play(case, "ours", solver_of(case.garment))
    (options.out / "settled.png").write_bytes(side_by_side([case for case in cases if case.number == 0], store))
    return table(cases, store)


def side_by_side(cases: list[Case], store: Store) -> bytes:
    """A PNG file with a row for each case: ours from above and from the side, then the reference likewise."""
    rows = []
    for case in cases:
        shots = []
        for engine in ("ours", "reference"):
            footage = Footage(f"{case.name} {engine}", store.states(case, engine)[None], case.garment.faces)
            shots += pictures(footage, "both", WIDTH_PX)
        rows.append(np.concatenate(shots, axis=1))
    return png_bytes(np.concatenate(rows))


def _reference(garment: Garment) -> Engine:
    from benchmarks.vbd import Vbd  # newton is needed only where the reference has not been computed yet

    return Vbd(garment)


def table(cases: list[Case], store: Store) -> str:
    """Our figures, the reference's and how far ours are off, by case, then the means by kind."""
    lines = [
        "| case | coverage ours / reference [cm²] | off | 95 % of z [mm] | off | highest z [mm] | off |",
        f"|{'---|' * 7}",
    ]
    off: dict[Case, list[float]] = {}
    for case in cases:
        ours, theirs = (store.figures(case, engine) or {} for engine in ("ours", "reference"))
        off[case] = [ours[m] / theirs[m] - 1 for m in MEASURES]
        pairs = [_pair(ours[m], theirs[m], 1e4 if m == "coverage" else 1e3) for m in MEASURES]
        cells = [cell for pair, share in zip(pairs, off[case], strict=True) for cell in (pair, f"{share:+.0%}")]
        lines.append(f"| {case.name} | {' | '.join(cells)} |")
    for title in ("drop", "pick", ""):
        shares = np.array([off[case] for case in cases if title in case.kind])
        if len(shares):
            spread = shares.std(0) / np.sqrt(len(shares))
            cells = [f" | {m:+.0%} ± {e:.0%}" for m, e in zip(shares.mean(0), spread, strict=True)]
            lines.append(f"| **mean of {title or 'all'}{'s' if title else ''}** |{' |'.join(cells)} |")
    return "\n".join(lines)


def _pair(ours: float, theirs: float, scale: float) -> str:
    return f"{scale * ours:.0f} / {scale * theirs:.0f}" if scale > 1e3 else f"{scale * ours:.1f} / {scale * theirs:.1f}"


if __name__ == "__main__":
    console = Console(stderr=True)
    print(compare(tyro.cli(Options), console))
