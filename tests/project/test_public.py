"""The public names of ``adhesis``, and what each one's docstring has to say."""

from __future__ import annotations

import ast
import builtins
import inspect
import re
from pathlib import Path
from typing import Any

import pytest

import adhesis

ROOT = Path(__file__).resolve().parent.parent.parent

REFERENCE = (ROOT / "docs" / "reference.rst").read_text()
PUBLIC = sorted({*re.findall(r"auto\w+:: adhesis\.(\w+)$", REFERENCE, re.MULTILINE)} - {"open"})
BESIDE = ["open"]
"""Public as well, but not taken by a star import: it would replace a built-in name."""


def test_the_public_names_are_those_of_the_reference() -> None:
    assert sorted(adhesis.__all__) == PUBLIC
    beside = {"annotations", "import_module", "TYPE_CHECKING"}
    offered = {n for n in dir(adhesis) if not n.startswith("_") and n not in beside}
    public = {n for n in offered if not inspect.ismodule(getattr(adhesis, n))}
    assert public == {*PUBLIC, *BESIDE}
    assert (ROOT / "adhesis" / "py.typed").exists()
    with pytest.raises(AttributeError, match="no attribute 'run_lop'"):
        adhesis.run_lop  # noqa: B018


def test_type_checkers_see_the_modules_that_the_running_program_loads() -> None:
    """The names of ``adhesis`` stand there twice: as imports and as a table."""
    tree = ast.parse((ROOT / "adhesis" / "__init__.py").read_text())
    (branch,) = (node for node in tree.body if isinstance(node, ast.If))
    imports = {
        alias.name: str(node.module).removeprefix("adhesis.")
        for node in branch.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert imports == adhesis._MODULES


def test_a_star_import_leaves_the_built_in_names_alone() -> None:
    names: dict[str, Any] = {}
    exec("from adhesis import *", names)
    assert set(names) & set(dir(builtins)) == {"__builtins__"} & set(dir(builtins))
    assert names["Profile"] is adhesis.Profile
