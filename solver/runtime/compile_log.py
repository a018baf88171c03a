"""Log a message when a first call waits for compilation.

The logger is Python's ``adhesis``, whose warnings go to stderr by default. ``precompile.warm``
silences these messages, as its caller reports progress itself.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cache

from adhesis.solver.runtime.jit import Compilation, processor, watch_compilation

_FIRST_AFTER = 1.0  # s of compilation before the first message
_BETWEEN = 10.0  # s between messages
_log = logging.getLogger("adhesis")
_silencers: list[None] = []


@contextmanager
def silence_compile_log() -> Iterator[None]:
    """Silence these messages while the caller reports progress itself."""
    _silencers.append(None)
    try:
        yield
    finally:
        _silencers.pop()


class _CompileLogger:
    def __init__(self) -> None:
        self._next = _FIRST_AFTER

    def __call__(self, seen: Compilation) -> None:
        passed = seen.seconds + seen.under_way
        if passed < self._next or _silencers:
            return
        if self._next == _FIRST_AFTER:
            _log.warning(
                "compiling for %s, once, which takes one to two minutes "
                "(adhesis warm does it ahead)",
                processor(),
            )
        else:
            _log.warning("compiling: %d functions in %.0f s", seen.functions, passed)
        self._next = passed + _BETWEEN


@cache
def log_compilation() -> AbstractContextManager[Compilation]:
    """Log compilation until the process ends; return the context, which the cache keeps open."""
    context = watch_compilation(_CompileLogger())
    context.__enter__()
    return context
