"""A word where the compiler makes one wait who runs a loop from Python.

The first use of a method, where nothing is compiled for this processor yet, tells of it by Python's
logging, under the name ``adhesis``, which prints warnings to stderr unless it is told otherwise.
``precompile.warm`` is told to tell in its caller's way.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from adhesis.solver.runtime.jit import Compilation, processor, watch_compilation

_MOMENT = 1.0  # s that pass without a word
_BETWEEN_LINES = 10.0  # s
_log = logging.getLogger("adhesis")
_hushed: list[None] = []


@contextmanager
def hushed() -> Iterator[None]:
    """While this lasts, another tells."""
    _hushed.append(None)
    try:
        yield
    finally:
        _hushed.pop()


class _Teller:
    def __init__(self) -> None:
        self._next = _MOMENT

    def __call__(self, seen: Compilation) -> None:
        passed = seen.seconds + seen.under_way
        if passed < self._next or _hushed:
            return
        if self._next == _MOMENT:
            _log.warning(
                "compiling for %s, once, in a minute or so (adhesis warm does it ahead)",
                processor(),
            )
        else:
            _log.warning("compiling: %d functions in %.0f s", seen.functions, passed)
        self._next = passed + _BETWEEN_LINES


@cache
def tell_of_compiling() -> None:
    """From now on, as long as this process lives."""
    watch_compilation(_Teller()).__enter__()
