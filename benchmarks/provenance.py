"""Where figures come from: source, machine, command and time."""

import os
import platform
import shlex
import sys
from datetime import UTC, datetime
from pathlib import Path

from medor_learn.revision import revision

GIB = 1 << 30


def provenance() -> dict[str, str]:
    """Commit, date, machine and command of this process, ready to be shown."""
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "commit": revision() or "unknown",
        "machine": machine(),
        "command": shlex.join(["python", "-m", "benchmarks.run", *sys.argv[1:]]),
    }


def machine() -> str:
    """Processor, cores this process may use, memory."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / GIB
    return f"{_processor()}, {cores} cores, {memory:.0f} GB"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
