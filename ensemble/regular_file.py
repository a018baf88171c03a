"""Open files to read without waiting: a pipe, socket or device in the place of one is refused.

A pipe that nobody writes to would hold a program up until it is killed, and a device that has no
end would fill its memory.
"""

from __future__ import annotations

import os
import stat
from io import BufferedReader
from pathlib import Path

from adhesis.ensemble.errors import InputError, quoted

# A pipe that takes the place of the file after it was looked at is opened without waiting, too.
_WITHOUT_WAITING = os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
_KINDS = (
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def irregular(mode: int) -> str | None:
    """Return what a file with this mode is ("a pipe"); None for a regular file."""
    if stat.S_ISREG(mode):
        return None
    return next((kind for holds, kind in _KINDS if holds(mode)), "no ordinary file")


def open_regular(path: Path | str) -> BufferedReader:
    """Open a regular file to read its bytes; links are followed.

    Raises
    ------
    InputError
        If it is a directory, pipe, socket or device, or no file can have this name.
    OSError
        If it is missing or cannot be read.
    """
    try:
        mode = os.stat(path).st_mode
    except ValueError:  # a NUL, or characters that no name has
        raise InputError(f"{quoted(str(path))} is not the name of a file") from None
    _refuse(path, mode)  # before it is opened, which some devices take for a command
    descriptor = os.open(path, os.O_RDONLY | _WITHOUT_WAITING)
    try:
        _refuse(path, os.fstat(descriptor).st_mode)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def _refuse(path: Path | str, mode: int) -> None:
    kind = irregular(mode)
    if kind is not None:
        raise InputError(
            f"{path} is {kind}, not a file"
            + (": write its content to a file first" if kind != "a directory" else "")
        )
