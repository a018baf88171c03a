"""Exit codes of the commands, as docs/troubleshooting.md describes them."""

from __future__ import annotations

import signal

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
