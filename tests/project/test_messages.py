"""docs/troubleshooting.md has every message that a user can meet, and no other."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
PAGE = ROOT / "docs" / "troubleshooting.md"
ERRORS = {
    *("InputError", "WriteError", "RankError", "UnitError", "PathError", "OutputError"),
    *("ValueError", "TypeError", "NotImplementedError", "argparse.ArgumentTypeError"),
}
# Errors that are caught inside, or that a mistake of the code itself would raise.
INTERNAL = {
    "ensemble/report/tables/table.py": "tables are made by the code alone",
    "ensemble/results/head.py": "caught in read.py",
    "ensemble/results/write.py": "rows are made by the code alone",
    "solver/references": "closed forms are called by tests and the code alone",
    "solver/runtime/compiler.py": "compiled code; its callers have checked the shapes",
    "solver/validate": "refused by the command before",
}
# Short words of reasons that other messages contain.
PARTS = {"truncated", "head"}
# Functions that make the sentences of errors and warnings.
SENTENCES = {
    "solver/model/problem.py": ("full_contact",),
    "solver/loading/loop_result.py": ("warnings", "preload_warnings", "strain_warnings"),
    "solver/loading/zero_range.py": ("range_warnings",),
    "ensemble/loop/heights.py": ("_not_one_column", "closure_warning", "few_heights_warning"),
}


def text_of(node: ast.expr) -> str:
    """Return the text of a message, with … for values."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(text_of(part) for part in node.values)
    if isinstance(node, ast.BinOp):
        return text_of(node.left) + text_of(node.right)
    if isinstance(node, ast.BoolOp):
        return text_of(node.values[-1])
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "_sentence":
        return "… is …: it must be …"
    return "…"


def sentences(function: ast.FunctionDef, name: str) -> Iterator[tuple[str, str]]:
    """Return the texts that a function makes."""
    given = [n.value for n in ast.walk(function) if isinstance(n, ast.Return) and n.value]
    given += [
        n.args[0]
        for n in ast.walk(function)
        if isinstance(n, ast.Call) and ast.unparse(n.func).endswith(".append")
    ]
    for node in given:
        text = text_of(node)
        if len(text) > 1:
            yield f"{name}:{node.lineno}", text


def messages() -> Iterator[tuple[str, str]]:
    """Return every message that is raised, with its place."""
    files = [path for name in ("ensemble", "solver") for path in (ROOT / name).rglob("*.py")]
    for path in sorted([*files, *(ROOT / "adhesis").glob("*.py")]):
        name = path.relative_to(ROOT).as_posix()
        if any(name.startswith(internal) for internal in INTERNAL):
            continue
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and node.name in SENTENCES.get(name, ()):
                yield from sentences(node, name)
            if not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)):
                continue
            kind = ast.unparse(node.exc.func)
            if kind in ERRORS and node.exc.args:
                text = re.sub(r"…+", "…", text_of(node.exc.args[0]))
                if kind == "argparse.ArgumentTypeError":
                    text = f"… {text}"  # the option's name stands before it
                if re.sub(r"\W", "", text) and text not in PARTS:
                    yield f"{name}:{node.lineno}", text


def patterns() -> dict[str, re.Pattern[str]]:
    """Return the messages of the page's tables, as patterns."""
    rows = re.findall(r"^\| (`.*?`) \|", PAGE.read_text(), re.MULTILINE)
    found = {text for row in rows for text in re.findall(r"`([^`]+)`", row)}
    return {
        text: re.compile(".*".join(re.escape(part) for part in text.split("…")), re.DOTALL)
        for text in found
    }


@pytest.fixture(scope="module")
def raised() -> dict[str, str]:
    """Every message, by its place."""
    return dict(messages())


def test_every_message_is_on_the_page(raised: dict[str, str]) -> None:
    known = patterns().values()
    missing = {
        place: text
        for place, text in raised.items()
        if not any(pattern.fullmatch(text) for pattern in known)
    }
    assert missing == {}
    assert len(raised) > 150


def test_the_page_has_no_message_that_the_code_has_not(raised: dict[str, str]) -> None:
    first_steps = PAGE.read_text().partition("## First steps")[2].partition("## Values")[0]
    stale = [
        text
        for text, pattern in patterns().items()
        if f"`{text}`" not in first_steps
        and not any(pattern.fullmatch(message) for message in raised.values())
    ]
    assert stale == []


@pytest.mark.parametrize("name", INTERNAL)
def test_what_is_left_out_is_there(name: str) -> None:
    assert (ROOT / name).exists()
