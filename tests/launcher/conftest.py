"""Small cells for the launcher's tests: real processes on a real bus that do nothing."""

import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

FAKE = """
import time
from medor_wire.bus import join
from medor_wire.config import Settings

class Config(Settings, section="fake"):
    warm_up_s: float = 0.0

config = Config.from_environment()
with join("fake", config.bus) as bus:
    bus.ready(False, "compiling")
    time.sleep(config.warm_up_s)
    bus.ready()
    print("serving", flush=True)
    bus.run()
"""

CELL = """
services:
  router: {command: [python, -m, medor_wire.router]}
  eye: {command: [python, fake.py], deploy: {replicas: 2}}
  hand: {command: [python, fake.py], profiles: [sim], environment: {MEDOR_FAKE__WARM_UP_S: 0.5}}
"""


def eventually(condition: Callable[[], object], seconds: float = 5.0) -> float:
    """Seconds until `condition` holds."""
    start = time.monotonic()
    while not condition():
        assert time.monotonic() - start < seconds, "it never came true"
        time.sleep(0.01)
    return time.monotonic() - start


def gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def write_cell(folder: Path, cell: str = CELL, fake: str = FAKE) -> Path:
    """A compose.yaml with fake services in `folder`."""
    (folder / "fake.py").write_text(textwrap.dedent(fake))
    path = folder / "compose.yaml"
    path.write_text(cell)
    return path


@pytest.fixture
def cell_file(tmp_path: Path) -> Path:
    return write_cell(tmp_path)
