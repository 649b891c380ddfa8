"""How good reconstruction is on held-out garments: `python -m medor_recon.evaluate --data data/test/recon`.

Writes `records.jsonl` (a line for each observation and method), `summary.json`, `table.md` and `sheet.png` into a
folder. The same command goes on where it was stopped.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

from medor_cloth.dataset import Dataset
from medor_cloth.errors import ClothError
from medor_cloth.picture import png_bytes
from medor_recon.evaluate import oracle
from medor_recon.evaluate.observed import Observed, observations
from medor_recon.evaluate.report import markdown, summarize
from medor_recon.evaluate.sheet import row, sheet
from medor_recon.evaluate.stages import Source, Stages
from medor_recon.methods import METHODS
from medor_recon.networks import SHIPPED, Networks
from medor_wire.errors import MedorError

CONSOLE = Console(stderr=True)


@dataclass(frozen=True)
class Options:
    """Choices of one evaluation."""

    data: Path
    """Data set of kind `recon`, of the test split."""
    out: Path = Path("runs/evaluate")
    methods: tuple[str, ...] = ("medor",)
    """Names of `medor_recon.methods`."""
    weights: Path = SHIPPED
    """Folder of networks."""
    looks: int | None = None
    """Observations, evenly spread; all of them by default."""
    sheet: int = 6
    """Observations on the contact sheet, of the first method."""
    oracle_canonical: bool = False
    """Take the true canonical coordinates instead of a network's."""
    noise: float = 0.0
    """Spread of an error added to them, each pixel's own, in the NOCS cube."""
    bend: float = 0.0
    """Spread of a smooth error added to them."""
    oracle_shape: bool = False
    """Take the true shape, laid out by inverse distance weighting, instead of a completion network's."""
    device: str = "cpu"


def evaluate(options: Options) -> None:
    """Measure what is not measured yet, and sum up."""
    dataset = Dataset(options.data)
    if (dataset.kind, dataset.split) != ("recon", "test"):
        raise ClothError(f"expected held-out recon data, got {dataset.split} data of kind {dataset.kind}")
    unknown = sorted(set(options.methods) - set(METHODS))
    if unknown:
        raise ClothError(f"expected methods of {', '.join(METHODS)}, got {', '.join(unknown)}")
    options.out.mkdir(parents=True, exist_ok=True)
    _same_as_before(options)
    every = list(observations(dataset, options.looks))
    log = options.out / "records.jsonl"
    source = source_of(options)
    done = {(record["observation"], record["method"]) for record in read(log)}
    with log.open("a") as lines:
        for observed in track(every, "measuring", console=CONSOLE):
            stages = Stages(observed, source)
            for name in options.methods:
                if (observed.key, name) not in done:
                    lines.write(json.dumps(stages.record(METHODS[name])) + "\n")
            lines.flush()
    keys = {observed.key for observed in every}
    summary = summarize(r for r in read(log) if r["observation"] in keys and r["method"] in options.methods)
    (options.out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    (options.out / "table.md").write_text(markdown(summary))
    _write_sheet(every, source, options)
    CONSOLE.print(markdown(summary), soft_wrap=True, highlight=False, markup=False)


def source_of(options: Options) -> Source:
    """The first two stages as the options say."""
    networks = Networks(options.weights, options.device)

    def canonicalize(observed: Observed, preset: str):
        if options.oracle_canonical:
            chance = np.random.default_rng(list(sha256(observed.key.encode()).digest()))
            return oracle.canonicalized(observed, options.noise, options.bend, chance)
        network = networks.canonicalizer(preset, observed.category)
        return network.canonicalize(observed.category, observed.depth, observed.camera)

    def complete(observed: Observed, seen, preset: str):
        if options.oracle_shape:
            return oracle.completed(observed, seen)
        return networks.completion(preset, observed.category).complete(seen)

    return Source(canonicalize, complete)


def read(log: Path) -> Iterator[dict[str, Any]]:
    """The records of a log; a line that was cut off is none."""
    for line in log.read_text().splitlines(keepends=True) if log.exists() else ():
        if line.endswith("\n"):
            yield json.loads(line)


def _same_as_before(options: Options) -> None:
    """Records of other settings must not be mixed."""
    kept = {name: str(value) for name, value in asdict(options).items() if name not in ("methods", "looks", "sheet")}
    path = options.out / "options.json"
    if path.exists() and json.loads(path.read_text()) != kept:
        raise ClothError(f"{options.out} holds an evaluation with other options; choose another --out")
    path.write_text(json.dumps(kept, indent=2) + "\n")


def _write_sheet(every: list[Observed], source: Source, options: Options) -> None:
    if not options.sheet or not every:
        return
    chosen = np.linspace(0, len(every) - 1, min(options.sheet, len(every))).round().astype(int)
    rows = [row(Stages(every[k], source), METHODS[options.methods[0]]) for k in chosen]
    (options.out / "sheet.png").write_bytes(png_bytes(sheet(rows)))


def main() -> None:
    try:
        evaluate(tyro.cli(Options, description=__doc__))
    except (ClothError, MedorError) as error:
        sys.exit(f"evaluate: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
