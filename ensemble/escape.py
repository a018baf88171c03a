"""Escape texts from files, so that terminals and pages show them as they are."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence


def printable(text: str) -> str:
    r"""Spell out control characters (colours, cursor, title), for a terminal.

    Line ends and tabs stay; ESC becomes ``\x1b``.
    """
    return "".join(
        char if char in "\n\t" or char.isprintable() else char.encode("unicode_escape").decode()
        for char in text
    )


def one_line(text: str) -> str:
    """Join the lines of a text, and make it printable."""
    return printable(" ".join(text.split()))


def shell_word(path: object) -> str:
    """Quote a path for a command line; one that begins with "-" would be an option there."""
    text = f"{path}"
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def markdown(text: str) -> str:
    """Escape a text as Markdown: no image, link, HTML, code or table is made of it."""
    return re.sub(r"([\\`*\[\]<>&|])", r"\\\1", one_line(text))


def markdown_table(head: Sequence[str], *rows: Sequence[str], left_columns: int = 0) -> str:
    """Return a table of escaped cells, numbers in all columns but the first ``left_columns``."""
    rule = ["---" if column < left_columns else "---:" for column in range(len(head))]
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, rule, *rows))


def code_span(text: str) -> str:
    """Quote a text as code in Markdown."""
    text = one_line(text)
    ticks, space = fence(text, 1), " " if "`" in text else ""
    return f"{ticks}{space}{text}{space}{ticks}"


def fence(text: str, least: int = 3) -> str:
    """Return more backticks than any run in the text has, at least ``least``."""
    longest = max((len(run) for run in re.findall("`+", text)), default=0)
    return "`" * max(least, longest + 1)
