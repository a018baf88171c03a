"""Exit codes of the commands, as docs/troubleshooting.md describes them."""

from __future__ import annotations

import signal
import traceback

from adhesis.ensemble.errors import InputError, Terminated, WriteError, lack

DONE = 0
SOME_FAILED = 1
"""Tasks failed, rows are damaged, bounds are exceeded, or there is no answer."""
PIPE_CLOSED = 1
BAD_INPUT = 2
OUR_ERROR = 70  # EX_SOFTWARE
TOO_FEW_RESOURCES = 71  # EX_OSERR
WRITE_FAILED = 74  # EX_IOERR
RESUME = 75  # EX_TEMPFAIL
"""A run stopped early: the same command goes on."""
INTERRUPTED = 128 + signal.SIGINT
"""Of a run, by a second Ctrl-C: the first one stops it in order."""
TERMINATED = 128 + signal.SIGTERM


def ended_by(error: BaseException) -> tuple[int, str]:
    """Return the exit code of a command that an error has ended, and the sentence to report.

    The sentence is empty for a reader that has seen enough, and for an error of adhesis itself,
    whose traceback is printed.
    """
    match error:
        case InputError():
            return BAD_INPUT, str(error)
        case WriteError():
            return WRITE_FAILED, str(error)
        case BrokenPipeError():
            return PIPE_CLOSED, ""
        case Terminated():
            return TERMINATED, "terminated"
        case KeyboardInterrupt():
            return INTERRUPTED, "interrupted"
    if sentence := lack(error):
        return TOO_FEW_RESOURCES, sentence
    traceback.print_exception(error)
    return OUR_ERROR, ""
