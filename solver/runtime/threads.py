"""Limit linear algebra to one thread, and calls of a method to one thread at a time.

The libraries beneath numpy and scipy start one thread per core even for matrices of some tens of
rows. This gains nothing, the threads wait for one another on a busy machine, and their number
changes the last bits of a sum.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache, wraps
from threading import RLock
from typing import Any, Protocol, TypeVar

from adhesis.solver.runtime.uninterrupted import uninterrupted

F = TypeVar("F", bound=Callable[..., Any])

# The number of threads is a property of the process: restoring it while another caller computes
# would change the bits of that caller's sums. Compiled code and Python hold the interpreter's lock
# nearly all the time, so serialised callers are hardly slower than concurrent ones.
_in_use = RLock()


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
    """Limit linear algebra to one thread while ``function`` runs.

    Callers in other threads wait.
    """

    @wraps(function)
    def limited(*args: Any, **kwargs: Any) -> Any:
        with _in_use:
            # ThreadpoolController.limit() also asks each library for its version: 20 times as long
            threaded = [
                (library, threads)
                for library in _libraries().lib_controllers
                if (threads := library.num_threads) != 1
            ]
            try:
                for library, _ in threaded:
                    library.set_num_threads(1)
                return function(*args, **kwargs)
            finally:
                for library, threads in threaded:
                    library.set_num_threads(threads)

    decorated: Any = limited
    result: F = decorated
    return result


@cache
@uninterrupted  # the search calls back from C, where the exception of a signal handler is lost
def _libraries() -> Any:
    # The search finds loaded libraries only; compiled code would load these at its first call.
    import scipy.linalg.cython_blas
    import scipy.linalg.cython_lapack  # noqa: F401  # to load its library
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
