"""The package: its public names, what says who, what and how to cite, its wheel."""

from __future__ import annotations

import ast
import builtins
import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import adhesis
from tools.readme_without_links import readme

ROOT = Path(__file__).resolve().parent.parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_versions_agree() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    reported = dict(re.findall(r"^([a-z-]+): (.+)$", citation, re.MULTILINE))
    assert (reported["version"], reported["license"]) == (PROJECT["version"], PROJECT["license"])
    assert re.search(r'volume: 92\n    start: "062404"', citation)
    assert "value: arXiv:1511.08891" in citation
    assert adhesis.__version__ == PROJECT["version"]
    heads = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heads[0] == PROJECT["version"]


def test_the_readme_of_the_package_has_no_link_into_the_checkout() -> None:
    text = readme()
    assert text.startswith("# adhesis")
    assert len(text) > 0.8 * len((ROOT / "README.md").read_text())
    assert re.findall(r"\]\((?!https?:)", text) == []


@pytest.mark.slow(reason="installs everything anew and compiles once more")
def test_the_wheel_works_in_a_bare_environment() -> None:
    done = subprocess.run(
        [ROOT / "tools" / "check_package.sh"],
        env={"PATH": "/usr/bin:/bin", "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "package: good" in done.stdout


# ---------------------------------------------------------------------- public names

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
