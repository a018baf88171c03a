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

from solver.uninterrupted import uninterrupted

F = TypeVar("F", bound=Callable[..., Any])

# The number of threads belongs to the process: a caller that restored it while another is at work
# would change the bits of that other's sums. Compiled code and Python hold the interpreter's lock
# nearly all the time, so callers that take turns are hardly slower than callers side by side.
_in_use = RLock()


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
