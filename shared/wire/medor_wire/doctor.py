"""What is installed, what runs, and what to do about what is wrong."""

import importlib.metadata
import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Literal

from pydantic import BaseModel
from rich.table import Table

from medor_wire import compose
from medor_wire.bus import Health, join
from medor_wire.config import BusConfig
from medor_wire.launcher import is_free

OLDEST_PYTHON = (3, 11)
PACKAGES = (
    "medor-wire", "medor-cloth", "medor-recon", "medor-dynamics", "medor-planner", "medor-sim", "medor-robot",
    "medor-gateway", "eclipse-zenoh", "numpy", "numba", "pydantic", "open3d-cpu", "pybullet", "fastapi", "uvicorn",
)  # fmt: skip
LITTLE_MEMORY = 4 << 30
LITTLE_SHARED_MEMORY = 256 << 20
IMPORT_S = 60.0
LISTEN_S = 2.5
"""Long enough for two heartbeats."""
STALE_S = 3.0
EXPECTED = ("recon", "dynamics", "planner", "robot")
"""Services of every cell; a simulated one serves `robot` too."""

State = Literal["ok", "note", "wrong"]
COLOURS: dict[State, str] = {"ok": "green", "note": "yellow", "wrong": "bold red"}


class Finding(BaseModel):
    """One thing looked at. `remedy` says what to do unless all is well."""

    subject: str
    state: State
    found: str
    remedy: str = ""


def examine(router: str, port: int) -> list[Finding]:
    """Everything there is to know about this installation and the cell behind `router` and `port`."""
    return [
        interpreter(),
        *packages(PACKAGES),
        *services(),
        kernel_cache(),
        *machine(),
        *door(port),
        *cell(router),
    ]


def table(findings: Sequence[Finding]) -> Table:
    """The findings to read in a terminal."""
    shown = Table("", "what", "found", "what to do", box=None, pad_edge=False)
    for finding in findings:
        colour = COLOURS[finding.state]
        shown.add_row(f"[{colour}]{finding.state}", finding.subject, finding.found, finding.remedy)
    return shown


def interpreter() -> Finding:
    found = f"{sys.version.split()[0]} at {sys.prefix}"
    if sys.version_info >= OLDEST_PYTHON:
        return Finding(subject="python", state="ok", found=found)
    oldest = ".".join(map(str, OLDEST_PYTHON))
    return Finding(subject="python", state="wrong", found=found, remedy=f"make setup PYTHON=python{oldest} (or newer)")


def packages(names: Sequence[str]) -> Iterator[Finding]:
    for name in names:
        try:
            yield Finding(subject=name, state="ok", found=importlib.metadata.version(name))
        except importlib.metadata.PackageNotFoundError:
            yield Finding(subject=name, state="wrong", found="not installed", remedy="make setup")


def services() -> list[Finding]:
    """Whether what compose.yaml starts can be imported, each in a process of its own: a bad native library may
    take its process down."""
    try:
        declared = compose.read(compose.find(), os.environ)
    except compose.ComposeError as error:
        return [Finding(subject=compose.FILE, state="wrong", found=str(error), remedy="run this inside a checkout")]
    modules = [service.command[2] for service in declared.values() if service.command[1:2] == ("-m",)]
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        return list(pool.map(importable, modules))


def importable(module: str) -> Finding:
    """Whether a fresh process can import `module`."""
    try:
        tried = subprocess.run(
            [sys.executable, "-c", f"import {module}"], capture_output=True, text=True, timeout=IMPORT_S
        )
    except subprocess.TimeoutExpired:
        return Finding(
            subject=module, state="wrong", found=f"import takes over {IMPORT_S:.0f} s", remedy="is this disk very slow?"
        )
    if tried.returncode == 0:
        return Finding(subject=module, state="ok", found="can be imported")
    said = tried.stderr.strip().splitlines() or [f"ended with code {tried.returncode}"]
    return Finding(subject=module, state="wrong", found=said[-1], remedy=remedy_for(said[-1]))


def remedy_for(complaint: str) -> str:
    """What to do about a failed import."""
    if ".so" in complaint:
        return "install the system library it names (Debian: libgl1 libegl1 libx11-6 libgomp1)"
    return "make setup; if it stays, this is a defect: please report it with `python -c 'import …'`"


def kernel_cache() -> Finding:
    """Whether numba can keep compiled kernels; without, every start compiles for minutes."""
    cloth = importlib.util.find_spec("medor_cloth")
    beside = Path(cloth.origin).parent / "__pycache__" if cloth and cloth.origin else Path("__pycache__")
    home = Path(os.environ.get("XDG_CACHE_HOME", "~/.cache")).expanduser() / "numba"
    given = os.environ.get("NUMBA_CACHE_DIR")
    for folder in [Path(given)] if given else [beside, home]:
        if writable(folder):
            return Finding(subject="kernel cache", state="ok", found=str(folder))
    remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
    return Finding(subject="kernel cache", state="wrong", found="nowhere to write", remedy=remedy)


def writable(folder: Path) -> bool:
    """Whether `folder` can be written to, or made."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    return existing.is_dir() and os.access(existing, os.W_OK)


def machine() -> Iterator[Finding]:
    cores = os.cpu_count() or 1
    slow = Finding(subject="cores", state="note", found="1", remedy="two or more make planning bearable")
    yield slow if cores < 2 else Finding(subject="cores", state="ok", found=str(cores))
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    remedy = "the cell needs about 4 GB; run services on other hosts" if memory < LITTLE_MEMORY else ""
    yield Finding(subject="memory", state="note" if remedy else "ok", found=gigabytes(memory), remedy=remedy)
    shared = Path("/dev/shm")
    if shared.is_dir():
        free = shutil.disk_usage(shared).free
        remedy = "images travel slower; docker run --shm-size=1g" if free < LITTLE_SHARED_MEMORY else ""
        found = f"{gigabytes(free)} free"
        yield Finding(subject="shared memory", state="note" if remedy else "ok", found=found, remedy=remedy)


def gigabytes(size: int) -> str:
    return f"{size / (1 << 30):.1f} GB"


def door(port: int) -> Iterator[Finding]:
    """Who listens on the HTTP port: nobody, a cell, or somebody else."""
    subject = f"port {port}"
    if is_free(port):
        yield Finding(subject=subject, state="ok", found="free")
        return
    try:
        urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=2).close()
        yield Finding(subject=subject, state="ok", found="Medor's HTTP door answers")
    except (urllib.error.URLError, OSError, ValueError) as error:
        remedy = f"stop what listens there, or: medor up --port {port + 1}"
        yield Finding(subject=subject, state="note", found=f"taken by something else ({error})", remedy=remedy)


def cell(router: str) -> Iterator[Finding]:
    """Which services are on the bus, and whether they are ready."""
    if not reachable(router):
        yield Finding(subject="cell", state="note", found=f"none at {router}", remedy="start one: medor up")
        return
    with join("doctor", BusConfig(router=router)) as bus:
        time.sleep(LISTEN_S)
        heard = bus.health()
        yield Finding(subject="cell", state="ok", found=f"{len(heard)} processes at {router}")
        for name, health in sorted(heard.items()):
            yield process(name, health)
        for service in EXPECTED:
            if not bus.instances(service):
                remedy = "its log says why: runs/logs, or docker compose logs"
                yield Finding(subject=service, state="wrong", found="nobody serves it", remedy=remedy)


def process(name: str, health: Health) -> Finding:
    """What the last heartbeat of one process says."""
    found = f"up {health.uptime_s:.0f} s, {health.busy} requests, heard of {health.age_s:.1f} s ago"
    if health.ready and health.age_s < STALE_S:
        return Finding(subject=name, state="ok", found=f"ready, {found}")
    remedy = "wait for it" if health.age_s < STALE_S else "it is stuck or gone: look at its log, restart it"
    return Finding(subject=name, state="wrong", found=f"{health.detail or 'not ready'}, {found}", remedy=remedy)


def reachable(router: str) -> bool:
    """Whether something accepts connections at a Zenoh endpoint such as `tcp/127.0.0.1:7447`."""
    host, _, port = router.partition("/")[2].rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=2).close()
    except (OSError, ValueError):
        return False
    return True
