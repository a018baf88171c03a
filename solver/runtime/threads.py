"""One thread at a time: in linear algebra, wherever the process was started, and in a method.

The libraries beneath numpy and scipy start a thread a core for matrices of some tens of rows. They
gain nothing there, wait for one another on a busy machine, and the number of threads changes the
last bits of a sum.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache, wraps
from threading import RLock
from typing import Any, Protocol, TypeVar

from adhesis.solver.runtime.uninterrupted import uninterrupted

F = TypeVar("F", bound=Callable[..., Any])

# The number of threads belongs to the process: a caller that restored it while another is at work
# would change the bits of that other's sums. Compiled code and Python hold the interpreter's lock
# nearly all the time, so callers that take turns are hardly slower than callers side by side.
_in_use = RLock()


class Shared(Protocol):
    """An object whose decorated methods threads call in turn."""

    in_use: AbstractContextManager[Any]


def new_lock() -> AbstractContextManager[Any]:
    """Lock that the thread which holds it may take again."""
    return RLock()


def one_at_a_time(function: F) -> F:
    """Let one thread at a time call the decorated methods of an object; the others wait.

    Methods reuse work arrays and plans from call to call. Between calls nothing but counters and
    caches is kept, so threads that take turns get the same bits as one alone.
    """

    @wraps(function)
    def waiting(self: Shared, *args: Any, **options: Any) -> Any:
        with self.in_use:
            return function(self, *args, **options)

    guarded: Any = waiting
    answer: F = guarded
    return answer


def on_one_thread(function: F) -> F:
    """Let linear algebra use one thread while ``function`` runs, and as before afterwards.

    Callers in other threads wait.
    """

    @wraps(function)
    def limited(*args: Any, **kwargs: Any) -> Any:
        with _in_use, _libraries().limit(limits=1):
            return function(*args, **kwargs)

    limited_function: Any = limited
    answer: F = limited_function
    return answer


@cache
@uninterrupted  # the search calls back from C, where the exception of a signal handler is lost
def _libraries() -> Any:
    # The search finds what is loaded: compiled code loads these at its first call.
    import scipy.linalg.cython_blas
    import scipy.linalg.cython_lapack  # noqa: F401  # to load its library
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
