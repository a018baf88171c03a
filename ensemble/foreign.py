"""What comes from others' hands, names of files and texts in them, made harmless to use."""

from __future__ import annotations

import os
from pathlib import Path


def printable(text: str) -> str:
    r"""Return a text for the terminal: control characters (colours, cursor, title) spelled out.

    Line ends stay; ESC becomes ``\x1b``.
    """
    return "".join(
        char if char == "\n" or char.isprintable() else char.encode("unicode_escape").decode()
        for char in text
    )


def one_line(text: str) -> str:
    """Return a text on one line, printable."""
    return printable(" ".join(text.split()))


def target(path: Path | str) -> Path:
    """Return the file that a path leads to: that of a symbolic link, or the path itself.

    Other paths stay as they were given, for messages.
    """
    path = Path(path)
    return Path(os.path.realpath(path)) if path.is_symlink() else path
