"""Escape texts from files, so that terminals and pages show them as they are."""

from __future__ import annotations

import re


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
