"""Limit linear algebra to one thread, and calls of a method to one thread at a time.

The libraries beneath numpy and scipy start one thread per core even for matrices of some tens of
rows. This gains nothing, the threads wait for one another on a busy machine, and their number
changes the last bits of a sum.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache, wraps
from threading import Lock, RLock
from typing import Any, Protocol, TypeVar

from adhesis.solver.runtime.uninterrupted import uninterrupted

F = TypeVar("F", bound=Callable[..., Any])

# The number of threads is a property of the process: the first caller limits it, and the last one
# restores it, or the bits of another caller's sums would change. Callers compute side by side.
_change = Lock()
_callers: set[object] = set()
_threaded: list[tuple[Any, int]] = []  # libraries that had more, with their numbers


class Shared(Protocol):
    """An object whose decorated methods one thread at a time may call."""

    in_use: AbstractContextManager[Any]


def new_lock() -> AbstractContextManager[Any]:
    """Make a reentrant lock."""
    return RLock()


def one_at_a_time(function: F) -> F:
    """Let one thread at a time call the decorated methods of an object; the others wait.

    Methods reuse work arrays and plans in every call. Only counters and caches persist between
    calls, so the results do not depend on the threads, to the last bit.
    """

    @wraps(function)
    def waiting(self: Shared, *args: Any, **options: Any) -> Any:
        with self.in_use:
            return function(self, *args, **options)

    decorated: Any = waiting
    result: F = decorated
    return result


def on_one_thread(function: F) -> F:
    """Limit linear algebra to one thread while ``function`` runs."""

    @wraps(function)
    def limited(*args: Any, **kwargs: Any) -> Any:
        caller = object()
        try:
            _enter(caller)
            return function(*args, **kwargs)
        finally:
            _leave(caller)

    decorated: Any = limited
    result: F = decorated
    return result


def _enter(caller: object) -> None:
    with _change:
        _callers.add(caller)
        if len(_callers) == 1:
            # ThreadpoolController.limit() also asks each library for its version: 20 times as long
            for library in _libraries().lib_controllers:
                if (threads := library.num_threads) != 1:
                    _threaded.append((library, threads))
                    library.set_num_threads(1)


def _leave(caller: object) -> None:
    with _change:
        _callers.discard(caller)
        if not _callers:
            for library, threads in _threaded:
                library.set_num_threads(threads)
            _threaded.clear()


@cache
@uninterrupted  # the search calls back from C, where the exception of a signal handler is lost
def _libraries() -> Any:
    # The search finds loaded libraries only; compiled code would load these at its first call.
    import scipy.linalg.cython_blas
    import scipy.linalg.cython_lapack  # noqa: F401  # to load its library
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
