"""Work that no signal handler interrupts half-way: it is done in a thread of its own.

Python runs the handlers of signals (Ctrl-C, a time limit) between any two steps of the main thread,
and nowhere else. What one of them raises there is lost where C code has called back into Python,
and leaves half of what was being made. Here the main thread only waits. It is interrupted at once;
the work ends by itself, at its next call of such a function.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from functools import wraps
from queue import SimpleQueue
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

# Bytes of stack, as LLVM may need them: without a limit on the main thread's the system gives 2 MB.
_STACK = 64 << 20


class _Abandoned(BaseException):
    """Nobody waits for this work any more."""


class _Worker(threading.Thread):
    abandoned = False


def _start(worker: _Worker) -> None:
    """Start a thread, to which no signal comes that Python handles.

    Meanwhile they wait: :mod:`threading` does not expect a handler's exception there.
    """
    handled = {each for each in signal.valid_signals() if callable(signal.getsignal(each))}
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, handled)
    size = threading.stack_size(_STACK)
    try:
        worker.start()
    finally:
        threading.stack_size(size)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def uninterrupted(function: F) -> F:
    """Run ``function`` where no signal handler runs; its result, or what it raises, is the same."""

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

    guarded_function: Any = guarded
    answer: F = guarded_function
    return answer
