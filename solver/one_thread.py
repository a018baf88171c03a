"""Linear algebra on one thread, wherever the process was started.

The libraries beneath numpy and scipy start a thread a core for matrices of some tens of rows. They
gain nothing there, wait for one another on a busy machine, and the number of threads changes the
last bits of a sum.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from threading import RLock
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


class _Limit:
    """The limit of the process, set by the first caller and lifted by the last.

    It belongs to the process, not to a thread: a caller that lifted it while another is at work
    would change the bits of that other's sums, and the other would then restore the limit for ever.
    """

    def __init__(self) -> None:
        self._guard = RLock()
        self._callers = 0
        self._limiter: Any = None

    def __enter__(self) -> None:
        with self._guard:
            if self._callers == 0:
                self._limiter = _libraries().limit(limits=1)
            self._callers += 1

    def __exit__(self, *raised: object) -> None:
        with self._guard:
            self._callers -= 1
            if self._callers == 0:
                self._limiter.restore_original_limits()


_limit = _Limit()


def on_one_thread(function: F) -> F:
    """Let linear algebra use one thread while ``function`` runs, and as before afterwards."""

    @wraps(function)
    def limited(*args: Any, **kwargs: Any) -> Any:
        with _limit:
            return function(*args, **kwargs)

    limited_function: Any = limited
    answer: F = limited_function
    return answer


@cache
def _libraries() -> Any:
    # The search finds what is loaded: compiled code loads these at its first call.
    import scipy.linalg.cython_blas
    import scipy.linalg.cython_lapack  # noqa: F401  # to load its library
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
