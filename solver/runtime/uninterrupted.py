"""Run functions in a separate thread, where no signal handler interrupts them.

Python runs signal handlers (Ctrl-C, a time limit) between any two steps of the main thread only.
An exception raised there is lost if C code has called back into Python, and it leaves incomplete
objects behind. Here the main thread only waits and is interrupted at once; the work ends at its
next call of such a function.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from queue import SimpleQueue
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

# Stack in bytes of the thread: the default is 2 MB if the main thread's stack is unlimited.
_STACK = 64 << 20


class _Abandoned(BaseException):
    """Error that ends work whose result is no longer awaited."""


class _Worker(threading.Thread):
    abandoned = False


@contextmanager
def signals_held() -> Iterator[None]:
    """Hold back the signals that Python handles until the block has ended.

    The exception of a handler then arrives from here. Inside code that drops exceptions, as the
    callbacks of weak references in h5py and :mod:`threading` are, it would be lost.
    """
    handled = {each for each in signal.valid_signals() if callable(signal.getsignal(each))}
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, handled)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _start(worker: _Worker) -> None:
    """Start a thread with all signals blocked that Python handles."""
    size = threading.stack_size(_STACK)
    try:
        with signals_held():
            worker.start()
    except KeyError as error:
        # A signal that reached another thread is handled here all the same. If its handler raises
        # after the new thread has begun, `threading` fails to strike it off a second time.
        raise error if error.__context__ is None else error.__context__ from None
    finally:
        threading.stack_size(size)


def uninterrupted(function: F) -> F:
    """Run ``function`` in a separate thread; its result or exception is passed on."""

    @wraps(function)
    def guarded(*args: Any, **kwargs: Any) -> Any:
        here = threading.current_thread()
        if isinstance(here, _Worker) and here.abandoned:
            raise _Abandoned
        if here is not threading.main_thread():
            return function(*args, **kwargs)
        answers: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()

        def work() -> None:
            try:
                answers.put((function(*args, **kwargs), None))
            except BaseException as error:
                answers.put((None, error))

        worker = _Worker(target=work)
        try:
            _start(worker)
            result, error = answers.get()
        except BaseException:
            worker.abandoned = True
            raise
        if error is not None:
            raise error
        return result

    return cast(F, guarded)
