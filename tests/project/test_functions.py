"""Size of functions, and where constants stand, read from the sources."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

SHARP = Path(__file__).resolve().parent.parent.parent / "solver" / "sharp"
FOLDERS = (
    "gap", "field", "equilibrium", "descent", "system", "nucleation", "output", "continuation",
)  # fmt: skip
LONGEST = 80  # lines of a function
MOST_PARAMETERS = 8

# Numbers of a formula or a table, which are no tolerance; all others stand in tolerances.py.
MATHEMATICAL = {
    "gap/chebyshev_moments.py": {"_LARGEST", "_SAFE"},  # range of a series; its bound
    "gap/conformal_map.py": {"_COLUMNS", "_PER_UNIT"},  # sizes of tables
    # sizes of Gauss rules
    "gap/full_contact_stress.py": {"_TILT_NODES", "_PIECES_BY_SLOPE", "_HALF_PLANE_NODES"},
    "gap/sine_transform.py": {"_ROTATIONS"},
    "descent/implicit_flow.py": {"AT_REST", "VANISHED", "STEP_LIMIT", "NO_FIELD", "OUTGROWN"},
    "output/grid_fields.py": {"_FINER"},  # nodes of an output, not of a loop
    # nodes and numbers of trials of a diagnosis, which no loss depends on
    "field/patch_tension.py": {"_COARSE", "_POINTS", "_MOVES"},
    "output/interior_tension.py": {"_CANDIDATES"},
    "field/assembly.py": {"_PERIODIC_SERIES", "_MAPPED_SERIES"},  # ranges of series
    "field/cholesky.py": {"BLOCK"},
    "field/opening_series.py": {"_MANY_NODES"},  # size of a table
}


MODULES = [
    f"{folder}/{path.name}" for folder in FOLDERS for path in sorted((SHARP / folder).glob("*.py"))
]


def tree_of(name: str) -> ast.Module:
    return ast.parse((SHARP / name).read_text("utf-8"))


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    for name in MODULES:
        for node in ast.walk(tree_of(name)):
            if isinstance(node, ast.FunctionDef):
                yield f"{name}: {node.name}", node


def test_no_function_is_longer_than_a_page() -> None:
    found = {name: f.end_lineno - f.lineno + 1 for name, f in functions() if f.end_lineno}
    assert len(found) > 100
    assert {name: lines for name, lines in found.items() if lines > LONGEST} == {}


def test_functions_have_few_parameters() -> None:
    def count(f: ast.FunctionDef) -> int:
        given = [*f.args.posonlyargs, *f.args.args, *f.args.kwonlyargs]
        return sum(argument.arg != "self" for argument in given)

    many = [(name, f) for name, f in functions() if count(f) > MOST_PARAMETERS]
    kernels = [name for name, f in many if "compiled" in map(ast.unparse, f.decorator_list)]
    assert [name for name, _ in many] == kernels
    assert len(kernels) <= 5


@pytest.mark.parametrize("name", MODULES)
def test_tolerances_stand_in_their_table(name: str) -> None:
    numbers = {
        target.id
        for node in tree_of(name).body
        if isinstance(node, ast.Assign)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, int | float)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    assert numbers == MATHEMATICAL.get(name, set())


def test_the_table_names_each_tolerance_once_with_its_reason() -> None:
    body = ast.parse((SHARP / "tolerances.py").read_text("utf-8")).body
    names = []
    for node, reason in pairwise(body):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            names.append(node.targets[0].id)
            assert isinstance(reason, ast.Expr), names[-1]
            assert isinstance(reason.value, ast.Constant), names[-1]
            assert isinstance(reason.value.value, str), names[-1]
    assert len(names) == len(set(names)) > 10
