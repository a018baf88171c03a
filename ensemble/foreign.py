"""Show names and texts from files as plain text, and find the file that a link leads to."""

from __future__ import annotations

import os
import re
from pathlib import Path


def printable(text: str) -> str:
    r"""Return a text for the terminal: control characters (colours, cursor, title) spelled out.

    Line ends and tabs stay; ESC becomes ``\x1b``.
    """
    return "".join(
        char if char in "\n\t" or char.isprintable() else char.encode("unicode_escape").decode()
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


def markdown(text: str) -> str:
    """Return a text as Markdown that shows it as it is: no image, link, HTML, code or table."""
    return re.sub(r"([\\`*\[\]<>&|])", r"\\\1", one_line(text))


def code_span(text: str) -> str:
    """Return a text as Markdown that shows it as code."""
    text = one_line(text)
    ticks = fence(text, 1)
    space = " " if "`" in text else ""
    return f"{ticks}{space}{text}{space}{ticks}"


def fence(text: str, least: int = 3) -> str:
    """Return so many backticks that none in the text end what they begin."""
    longest = max((len(run) for run in re.findall("`+", text)), default=0)
    return "`" * max(least, longest + 1)
