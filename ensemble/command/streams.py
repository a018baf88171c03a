"""Make stdout and stderr safe: full devices, closed descriptors and ASCII terminals."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from typing import Any

from adhesis.ensemble.errors import WriteError, reason


class _Output(io.FileIO):
    """File descriptor of stdout or stderr: a message on stderr that cannot be written is lost.

    The first failure of stdout raises, what follows is dropped. Otherwise the interpreter would try
    to write the rest when it ends, and report that failure, too.
    """

    _failed = False

    def write(self, data: Any, /) -> int:
        try:
            if not self._failed:
                return super().write(data) or 0
        except OSError as error:
            self._failed = self.fileno() == 1
            if isinstance(error, BrokenPipeError) and self._failed:
                raise
            if self._failed:
                raise WriteError(f"stdout could not be written: {reason(error)}") from None
        return memoryview(data).nbytes


@contextlib.contextmanager
def standard_streams() -> Iterator[None]:
    """Replace the process's own stdout and stderr by safe ones, and open those that are closed.

    Characters that the encoding lacks appear as escapes. A closed stdout fails when something is
    printed. Streams that are not the process's own (of a notebook, of a test) stay as they are.
    """
    _open_closed_descriptors()
    before = sys.stdout, sys.stderr
    if sys.stdout is sys.__stdout__:
        sys.stdout = _stream(sys.stdout, io.BufferedWriter(_Output(1, "w", closefd=False)))
    if sys.stderr is sys.__stderr__:
        sys.stderr = _stream(sys.stderr, io.BufferedWriter(_Output(2, "w", closefd=False)), True)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(WriteError, OSError, ValueError):
                stream.flush()
        sys.stdout, sys.stderr = before


def _stream(like: Any, binary: io.BufferedWriter, by_line: bool = False) -> io.TextIOWrapper:
    if like is not None:
        like.flush()
    return io.TextIOWrapper(
        binary,
        encoding="utf-8" if like is None else like.encoding,
        errors="backslashreplace",
        line_buffering=by_line or (like is not None and like.line_buffering),
        write_through=like is not None and like.write_through,
    )


def _open_closed_descriptors() -> None:
    """Occupy descriptors 0 to 2 where they are closed: a results file could become stdout."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free number is taken. Writing to a stdout that is read-only fails.
            os.open(os.devnull, os.O_WRONLY if number == 2 else os.O_RDONLY)
