"""Interrupts on purpose: the handler of a timer's signal raises while something is at work."""

import gc
import signal
from collections.abc import Callable

Work = Callable[[], object]


class Interrupt(RuntimeError):
    """What the handler raises; no other code does."""


def interrupted(work: Work, delay: float) -> str:
    """Interrupt ``work`` after ``delay`` seconds; returns what it ended in.

    "raised" (what the handler raised), "done" (before that), "lost" (the handler raised, and
    nothing arrived), or another exception.
    """
    raised: list[Interrupt] = []

    def handler(number: int, frame: object) -> None:
        raised.append(Interrupt())
        raise raised[-1]

    before = signal.signal(signal.SIGALRM, handler)
    # Python drops what is raised inside a finalizer; the collector runs those of other objects.
    collects = gc.isenabled()
    gc.disable()
    try:
        signal.setitimer(signal.ITIMER_REAL, delay)
        work()
        signal.setitimer(signal.ITIMER_REAL, 0)
    except BaseException as error:
        signal.setitimer(signal.ITIMER_REAL, 0)
        if raised and error is raised[0]:
            return "raised"
        return f"{type(error).__name__}: {error}"[:200]
    finally:
        signal.signal(signal.SIGALRM, before)
        if collects:
            gc.enable()
    return "lost" if raised else "done"
