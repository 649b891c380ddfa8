"""How the solver's inner loops are compiled, and where the machine code is kept."""

import os
import shutil
from hashlib import sha256
from pathlib import Path

from numba import njit
from numba.core import config

kernel = njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz"})
"""Compiles a function to machine code that runs without the interpreter lock.

Sums are not reordered, products not fused and roots not approximated: which of a loop's vector and scalar versions
runs depends on where its arrays happen to lie in memory, and both must give the same bits.
"""


def cache_for(package: Path) -> Path:
    """Folder for the machine code of a package's source as it is now (its modules' bytes, not their dates)."""
    digest = sha256(b"".join(file.read_bytes() for file in sorted(package.glob("*.py")))).hexdigest()
    return package / "__pycache__" / f"numba-{digest[:12]}"


def _keep_cache_by_source() -> None:
    """Numba recompiles when the file of a kernel changes, not when that of another kernel it calls does.

    Left alone where the package cannot be written: then it was installed, and all its files change together.
    """
    package = Path(__file__).parent
    if os.environ.get("NUMBA_CACHE_DIR") or not os.access(package, os.W_OK):
        return
    cache = cache_for(package)
    for stale in cache.parent.glob("numba-*"):
        if stale != cache:
            shutil.rmtree(stale, ignore_errors=True)
    config.CACHE_DIR = str(cache)  # pyright: ignore[reportAttributeAccessIssue]  (made at run time)


_keep_cache_by_source()
