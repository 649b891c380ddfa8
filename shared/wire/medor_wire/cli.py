"""The command `medor`: run a cell, watch it unfold a garment, look at cloth, find out what is wrong."""

import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Literal

import tyro
from rich.console import Console

from medor_wire import doctor as examination
from medor_wire.compose import ComposeError
from medor_wire.launcher import CellError, Launcher, heed_signals, is_free
from medor_wire.messages import DEFAULT_METHOD, Category, Task

ROUTER_PORT = 7447
"""Where a cell is looked for when nobody says otherwise."""


def up(profile: Literal["sim", "robot"] = "sim", port: int = 8080, router_port: int | None = None) -> int:
    """Run a cell with its HTTP door until Ctrl-C.

    Args:
        profile: the simulated cell or the real one.
        port: of the HTTP door, on loopback; 0 takes a free one.
        router_port: of the bus, on loopback; 7447 when that is free, else any.
    """
    if router_port is None:
        router_port = ROUTER_PORT if is_free(ROUTER_PORT) else 0
    with Launcher(profile, port=port, router_port=router_port) as cell:
        seconds = cell.wait_ready()
        cell.output.say(f"ready after {seconds:.1f} s: {cell.url} (bus {cell.router}). Ctrl-C ends it.")
        threading.Event().wait()
    return 0


def demo(
    method: str = DEFAULT_METHOD,
    category: Category = "tshirt",
    task: Task = "flatten",
    seed: int = 1,
    picks: int = 10,
    candidates: int = 100,
    exhaustive: bool = False,
    out: Path = Path("runs/demo"),
    url: str | None = None,
    key: str = "",
) -> int:
    """Crumple a garment in a simulated cell and unfold it; writes episode.json and report.html.

    Args:
        method: how the planner sees and foresees: medor+judge, visible, oracle, random, a row of the paper.
        category: of the garment.
        task: lay it flat anyhow, or into its canonical pose.
        seed: of the garment, the crumpling and the planning.
        picks: at most.
        candidates: pick-and-places imagined per pick.
        exhaustive: imagine each in full, none screened out by a rougher model.
        out: folder for the results.
        url: of a running cell; without it one is started and ended.
        key: API key of that cell, when it asks for one.
    """
    words = {
        "method": method,
        "category": category,
        "task": task,
        "seed": seed,
        "picks": picks,
        "candidates": candidates,
        "out": out,
        "key": key,
    }
    options = [text for name, value in words.items() for text in (f"--{name}", str(value))]
    options += ["--exhaustive"] if exhaustive else []

    def play(url: str) -> int:
        return subprocess.call([sys.executable, "-m", "medor_gateway.demo", "--url", url, *options])

    if url is not None:
        return play(url)
    open_door = {"MEDOR_GATEWAY__KEYS": ""}
    with Launcher("sim", environment=open_door, logs=out.resolve() / "logs", echo=False) as cell:
        seconds = cell.wait_ready()
        cell.output.say(f"cell ready after {seconds:.1f} s at {cell.url}, logs in {cell.output.folder}")
        return play(cell.url)


def doctor(router: str = f"tcp/127.0.0.1:{ROUTER_PORT}", port: int = 8080, as_json: bool = False) -> int:
    """Say what is installed, what runs, and what to do about what is wrong (exit code 1 if anything is).

    Args:
        router: Zenoh endpoint of the cell to look at.
        port: of the HTTP door to look at.
        as_json: print JSON instead of a table.
    """
    console = Console()
    findings = examination.examine(router, port)
    if as_json:
        console.print_json(json.dumps([finding.model_dump() for finding in findings]))
    else:
        console.print(examination.table(findings))
    return int(any(finding.state == "wrong" for finding in findings))


def view() -> int:
    """Show cloth as PNG, GIF or an interactive page: a mesh, a state, a rollout, a data set (medor view --help)."""
    return subprocess.call([sys.executable, "-m", "medor_cloth.view", *sys.argv[2:]])


def main() -> None:
    heed_signals()
    if sys.argv[1:2] == ["view"]:  # its words are the viewer's own
        sys.exit(view())
    try:
        commands = {"up": up, "demo": demo, "view": view, "doctor": doctor}
        sys.exit(tyro.extras.subcommand_cli_from_dict(commands, prog="medor", description=__doc__))
    except (CellError, ComposeError) as error:
        sys.exit(f"medor: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
