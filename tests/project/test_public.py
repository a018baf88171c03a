"""The public door: which names ``adhesis`` offers, and what each one's docstring has to say."""

from __future__ import annotations

import ast
import builtins
import dataclasses
import inspect
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

import adhesis

ROOT = Path(__file__).resolve().parent.parent.parent

PUBLIC = [
    "AdhesionPattern",
    "Campaign",
    "ContactState",
    "Control",
    "Fields",
    "HalfSpace",
    "InputError",
    "Jump",
    "LoopResult",
    "LoopState",
    "Method",
    "MinorLoop",
    "Opening",
    "Path",
    "PathError",
    "PathResult",
    "Problem",
    "Profile",
    "Trace",
    "load",
    "loss_of_trace",
    "make_method",
    "prepare_trace",
    "profile_from_heights",
    "read_trace",
    "run_loop",
    "run_loops",
    "run_path",
    "self_affine_profile",
    "single_wave",
    "stripes",
]
BESIDE = ["open"]
"""Public as well, but not taken by a star import: it would replace a built-in name."""
UNIT = re.compile(r"(?<!\w)(m|m²|Pa|J/m²?|rad/m|1/m|s|Pa/m|m\^[\w()-]+)(?!\w)")
NO_UNIT = re.compile(r"dimensionless|fraction|relative|exponent|ratio|Δ/h_max|W~ =|A/A0|H,|ν")
# Objects of this project or plain words: they have no unit.
WITHOUT_SIZE = re.compile(r"int|str|bool|dict|tuple|Literal|Callable|Any|Name|Kind|^[A-Z]\w+$")


def entries(text: str) -> dict[str, str]:
    """Return what a numpy docstring says of each parameter or attribute, by name."""
    found: dict[str, str] = {}
    sections = re.split(r"^(\w[\w ]*)\n-+$", text, flags=re.MULTILINE)
    for title, body in zip(sections[1::2], sections[2::2], strict=True):
        if title not in ("Parameters", "Attributes", "Other Parameters"):
            continue
        names: list[str] = []
        for line in body.strip("\n").splitlines():
            if line and not line.startswith(" "):
                head, _, kind = line.partition(" : ")
                names = [name.strip() for name in head.split(",")]
                found |= dict.fromkeys(names, kind)
            else:
                for name in names:
                    found[name] += " " + line.strip()
    return found


def arguments(thing: Any) -> dict[str, str]:
    """Return the fields of a dataclass or the parameters of a function, with their annotations."""
    if dataclasses.is_dataclass(thing):
        return {f.name: str(f.type) for f in dataclasses.fields(thing)}
    found = inspect.signature(thing).parameters.values()
    return {p.name: str(p.annotation) for p in found if p.name not in ("self", "cls")}


def test_the_public_names_are_these() -> None:
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


DESCRIBED = {
    name: thing
    for name in PUBLIC + BESIDE
    for thing in (getattr(adhesis, name),)
    if dataclasses.is_dataclass(thing) or inspect.isfunction(thing)
}


@pytest.mark.parametrize("name", DESCRIBED)
def test_arguments_and_fields_are_told_with_shapes_and_units(name: str) -> None:
    text = inspect.getdoc(DESCRIBED[name]) or ""
    reported = entries(text)
    for base in filter(dataclasses.is_dataclass, getattr(DESCRIBED[name], "__mro__", ())):
        reported |= entries(inspect.getdoc(base) or "")
    lead = text.split("\n\n")[0]
    assert [n for n in arguments(DESCRIBED[name]) if n not in reported] == []
    for argument, annotation in arguments(DESCRIBED[name]).items():
        kind = annotation.split(" | None")[0]
        words = reported[argument]
        if ("Array" in kind and "tuple" not in kind) or "Sequence" in kind:
            assert "shape" in words or "shape" in lead, f"{argument}: which shape?"
        if kind in ("float", "Array") or "complex" in kind or "Sequence[float]" in kind:
            assert UNIT.search(words) or NO_UNIT.search(words), f"{argument}: which unit?"
        else:
            assert WITHOUT_SIZE.search(kind) or "NDArray" in kind, f"{argument}: {kind}"


def test_pages_that_docstrings_name_have_their_sections() -> None:
    for name in PUBLIC + BESIDE:
        text = (inspect.getdoc(getattr(adhesis, name)) or "").replace("\n", " ")
        for page, section in re.findall(r"docs/([\w-]+\.md), \"([^\"]+)\"", text):
            headings = (ROOT / "docs" / page).read_text()
            assert re.search(rf"^#+ {re.escape(section)}$", headings, re.MULTILINE), (name, page)


def test_a_star_import_leaves_the_built_in_names_alone() -> None:
    names: dict[str, Any] = {}
    exec("from adhesis import *", names)
    assert set(names) & set(dir(builtins)) == {"__builtins__"} & set(dir(builtins))
    assert names["Profile"] is adhesis.Profile


def test_the_version_is_that_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert adhesis.__version__ == project["version"]
