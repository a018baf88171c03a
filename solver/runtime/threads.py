"""Limit linear algebra to one thread, and calls of a method to one thread at a time.

The libraries beneath numpy and scipy start one thread per core even for matrices of some tens of
rows. This gains nothing, the threads wait for one another on a busy machine, and their number
changes the last bits of a sum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cache, wraps
from threading import Lock, RLock
from typing import Any, TypeVar, cast

from adhesis.solver.runtime.uninterrupted import uninterrupted

F = TypeVar("F", bound=Callable[..., Any])

# The number of threads is a property of the process.
_limit = Lock()


def new_lock() -> AbstractContextManager[Any]:
    """Make a reentrant lock."""
    return RLock()


def one_at_a_time(function: F) -> F:
    """Let one thread at a time call the decorated methods of an object, by its lock ``in_use``.

    Methods reuse work arrays and plans in every call. What persists between calls is counters,
    caches, and without adhesion the states of the last loading: results do not depend on the
    threads, to the last bit.
    """

    @wraps(function)
    def waiting(self: Any, *args: Any, **options: Any) -> Any:
        with self.in_use:
            return function(self, *args, **options)

    return cast(F, waiting)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread; another caller waits until the limit is taken back."""
    with _limit, _libraries().limit(limits=1, user_api="blas"):
        yield


@cache
@uninterrupted  # the search calls back from C, where the exception of a signal handler is lost
def _libraries() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
