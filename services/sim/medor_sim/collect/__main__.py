"""Collect data sets of crumpled garments, look at them, turn them into other formats."""

import os
import re
import resource
import signal
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from medor_cloth.dataset import Dataset
from medor_cloth.errors import ClothError, DatasetError
from medor_sim.collect import export as exporting
from medor_sim.collect.contact_sheet import write_contact_sheet
from medor_sim.collect.plan import Plan
from medor_sim.collect.progress import CollectionProgress
from medor_sim.collect.shard import Shard
from medor_sim.collect.workers import collect_in_processes
from medor_wire.messages import Category

CONSOLE = Console(stderr=True)


@dataclass(frozen=True)
class Options:
    """What is collected of either kind, and where to."""

    category: Category
    """of the garments."""
    n: int
    """trajectories over all shards."""
    out: Path
    """folder of the data set."""
    shard: str = "0/1"
    """i/N, one of 0/N … N-1/N; the data does not depend on N."""
    seed: int = 0
    """another one gives other garments and other chances."""
    split: Literal["train", "test"] = "train"
    """garments for training (seeds below 800000) or for tests (800000 to 899999)."""
    per_garment: int = 10
    """trajectories of each garment; of pulls, two from each start state."""
    edge_m: float = 0.012
    """mean edge length of the meshes [m]."""
    workers: int = 0
    """processes; 0 means one per core."""
    preview: bool = False
    """write a picture of some trajectories beside the shard."""

    def plan(self, kind: Literal["recon", "dynamics"], winding: int = 0) -> Plan:
        return Plan(kind, self.category, self.n, self.seed, self.split, self.per_garment, self.edge_m, winding)


Unprefixed = Annotated[Options, tyro.conf.arg(name="")]


def recon(options: Unprefixed, winding: int = 64) -> None:
    """Trajectories of five observations of a garment that is picked at.

    The same command goes on where it was stopped.

    Args:
        options: what is collected.
        winding: nodes along each side of the winding-number grids; 0 stores none.
    """
    collect(options.plan("recon", winding), options)


def dynamics(options: Unprefixed) -> None:
    """Trajectories of one pull and the fall after it, every fifth frame.

    The same command goes on where it was stopped.

    Args:
        options: what is collected.
    """
    collect(options.plan("dynamics"), options)


def export(
    folder: tyro.conf.Positional[Path],
    out: Path,
    form: Annotated[Literal["npz", "ply"], tyro.conf.arg(name="format")] = "npz",
    first: int = 0,
    count: int | None = None,
) -> None:
    """Write trajectories as .npz (one file each, all arrays) or .ply (one file a state, coloured by NOCS).

    Args:
        folder: the data set, or one shard.
        out: folder for the files.
        form: of the files.
        first: index of the first trajectory.
        count: how many; all that follow when left out.
    """
    CONSOLE.print(f"{exporting.export(folder, out, form, first, count)} trajectories in {out}")


def preview(folder: tyro.conf.Positional[Path], out: Path, trajectories: int = 4) -> None:
    """Write a contact sheet of some trajectories.

    Args:
        folder: the data set, or one shard.
        out: PNG file to write.
        trajectories: how many, spread over the data set.
    """
    write_contact_sheet(folder, out, trajectories)


def collect(plan: Plan, options: Options) -> None:
    mine = Shard(plan, *parse_shard(options.shard), options.out)
    with mine.opened():
        with CollectionProgress(mine.total, mine.found, CONSOLE) as progress:
            cores = options.workers or len(os.sched_getaffinity(0))
            collect_in_processes(mine, mine.garments, cores, progress.written_one)
        spent = resource.getrusage(resource.RUSAGE_CHILDREN)
        hours = (spent.ru_utime + spent.ru_stime) / 3600
        CONSOLE.print(f"{progress.written} written in {hours:.3f} CPU-hours: {progress.written / hours:.0f} an hour")
        CONSOLE.print(f"{len(Dataset(mine.path))} trajectories in {mine.path}", soft_wrap=True)
    if options.preview:
        write_contact_sheet(mine.path, mine.path.with_suffix(".png"))


def parse_shard(text: str) -> tuple[int, int]:
    """(index, count) of a shard written as i/N, counted from 0."""
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if not match or int(match[1]) >= int(match[2]):
        raise DatasetError(f"expected --shard i/N with 0 <= i < N, got {text!r}")
    return int(match[1]), int(match[2])


def main() -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends the workers as Ctrl-C does
    commands = {"recon": recon, "dynamics": dynamics, "preview": preview, "export": export}
    try:
        tyro.extras.subcommand_cli_from_dict(commands, prog="medor_sim.collect", description=__doc__)
    except (ClothError, ValueError) as error:
        sys.exit(f"collect: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
