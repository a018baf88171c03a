"""Compiled functions, cached between processes by the sources they were compiled from.

numba's own cache knows only the file of a function, not the files of the functions that it calls:
after a change in one module, callers in another would silently keep the old code. So the cache
lies in a folder named after the content of all modules of this package. Where no folder can be
written the functions are compiled anew in each process.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from numba import config, njit

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile ``function`` at its first call (numba, nopython), keeping the result on disk.

    Division by zero gives inf or NaN, as in numpy: a test before every division would keep the
    loops out of vector registers.
    """
    return _compile(function)


def compiled_sums(function: F) -> F:
    """Compile ``function`` likewise, and let sums be taken in any order (vector registers)."""
    return _compile(function, fastmath={"reassoc", "contract", "nsz"})


def _compile(function: F, **options: Any) -> F:
    folder = _cache_folder()
    dispatcher: F
    if folder is None:
        dispatcher = njit(error_model="numpy", **options)(function)
        return dispatcher
    settings: Any = config  # its attributes are made at run time
    before = settings.CACHE_DIR
    try:
        settings.CACHE_DIR = str(folder)  # read when the function is decorated
        dispatcher = njit(cache=True, error_model="numpy", **options)(function)
    finally:
        settings.CACHE_DIR = before
    return dispatcher


@cache
def _cache_folder() -> Path | None:
    """Folder for the present sources, created; None if there is no place to write."""
    digest = hashlib.sha256()
    for module in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(module.read_bytes())
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        root = Path(base) if base else Path.home() / ".cache"
        folder = root / "adhesis" / digest.hexdigest()[:16]
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return folder if os.access(folder, os.W_OK) else None
