"""The package: what it says of itself, its wheel, its public names, what a process loads."""

import ast
import builtins
import doctest
import inspect
import pkgutil
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import adhesis
from tests.support.campaign_support import ROOT, run_python
from tests.support.instrument_files import sdf
from tests.support.processes import ran
from tests.support.synthetic_results import text_of, write
from tools.readme_without_links import readme
from tools.stub import stub

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_versions_agree() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    reported = dict(re.findall(r"^([a-z-]+): (.+)$", citation, re.MULTILINE))
    assert (reported["version"], reported["license"]) == (PROJECT["version"], PROJECT["license"])
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
    env = {"PATH": "/usr/bin:/bin", "PYTHON": sys.executable}
    done = ran(ROOT / "tools" / "check_package.sh", env=env, timeout=None)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "package: good" in done.stdout


REFERENCE = (ROOT / "docs" / "reference.rst").read_text()
PUBLIC = sorted({*re.findall(r"auto\w+:: adhesis\.(\w+)$", REFERENCE, re.MULTILINE)} - {"open"})
BESIDE = ["open"]
"""Public as well, but not taken by a star import: it would replace a built-in name."""


def test_the_public_names_are_those_of_the_reference() -> None:
    assert sorted(adhesis.__all__) == PUBLIC
    assert not {*PUBLIC} & {*dir(builtins)}  # of which a star import leaves all alone
    beside = {"annotations", "import_module", "TYPE_CHECKING"}
    offered = {n for n in dir(adhesis) if not n.startswith("_") and n not in beside}
    public = {n for n in offered if not inspect.ismodule(getattr(adhesis, n))}
    assert public == {*PUBLIC, *BESIDE}
    assert (ROOT / "adhesis" / "py.typed").exists()
    with pytest.raises(AttributeError, match="no attribute 'run_lop'"):
        adhesis.run_lop  # noqa: B018


def test_the_reference_names_what_there_is() -> None:
    names = re.findall(r"auto\w+:: (.+)$", REFERENCE, re.MULTILINE)
    assert len([pkgutil.resolve_name(name) for name in names]) > len(PUBLIC)


def test_all_examples_of_what_is_public_are_right() -> None:
    """Also those of methods, inherited ones included."""
    public = [getattr(adhesis, name) for name in [*adhesis.__all__, *BESIDE]]
    owners = {owner for each in public for owner in getattr(each, "__mro__", (each,))}
    modules = {owner.__module__ for owner in owners if owner.__module__.startswith("adhesis.")}
    assert {"adhesis.solver.views", "adhesis.solver.loading.loop"} < modules
    wrong = [name for name in sorted(modules) if doctest.testmod(sys.modules[name]).failed]
    assert wrong == []


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


# (The rules of imports are contracts of import-linter, in pyproject.toml.)

COMMANDS = """
import os, sys
before = {*sys.modules}
import adhesis.__main__
print("\\nloaded start", *{*sys.modules} - before)
from adhesis.ensemble.command.main import COMMANDS, main
def loaded(stage):
    print("\\nloaded", stage, *{name.split(".")[0] for name in sys.modules})
assert main([]) == 0 and main(["speed"]) == 2
for name in COMMANDS:
    assert main([name, "--help"]) == 0 and main([name, "--speed"]) == 2
loaded("help")
import numpy
before = "numpy.ma" in sys.modules
from adhesis.solver import checks
assert checks.real("young", 1e6, checks.YOUNG) == 1e6
assert ("numpy.ma" in sys.modules) == before, "checking a number loads masked arrays"
import adhesis
loaded("adhesis")
campaign, results, report, scan = sys.argv[1:]
os.environ |= {"PMIX_MCA_gds": "hash", "PRTE_MCA_plm": "ssh", "HYDRA_LAUNCHER": "ssh"}
for options in ([], ["--dry-run"], ["--redo", "failed"]):
    assert main(["run", campaign, "--out", results, *options]) == 0
assert main(["status", results]) == 0
loaded("nothing_to_do")
# Every figure is drawn; putting it on disk takes seconds and loads nothing of ours.
import adhesis.ensemble.report.figures.style as style
style.save = lambda *_, **__: None
assert main(["report", results, "--to", report]) == 0
loaded("report")
from adhesis.ensemble.trace.reading import instrument
if instrument.available():
    adhesis.read_trace(scan)
    loaded("scan")
import mpi4py
"""


def test_a_command_loads_no_more_than_it_needs(tmp_path: Path) -> None:
    """The settings are those of a site, and not of a rank."""
    one_cell = {"hurst": (0.8,), "gamma": (0.04,), "realisations": 2}
    results = write(tmp_path / "r.h5", text_of(**one_cell))
    (tmp_path / "c.toml").write_text(text_of(**one_cell))
    sdf(tmp_path / "a.sdf", 1e-6, np.sin(np.arange(99)) * 1e-7)
    made = (tmp_path / "report", tmp_path / "a.sdf")
    done = run_python("-c", COMMANDS, tmp_path / "c.toml", results, *made)
    assert done.returncode == 0, done.stderr
    lines = (line.split() for line in done.stdout.splitlines() if line.startswith("loaded "))
    loaded = {stage: set(names) for _, stage, *names in lines}
    numeric = {"scipy", "matplotlib", "mpi4py"}
    # Until there is a handler, Ctrl-C is a traceback.
    assert loaded["start"] & {"typing", "pathlib", "re"} == set()
    assert loaded["help"] & (numeric | {"numpy", "h5py", "pandas", "rich"}) == set()
    assert loaded["adhesis"] & (numeric | {"h5py", "xarray", "rich"}) == set()
    assert loaded["nothing_to_do"] & numeric == set()
    assert "matplotlib" in loaded["report"]
    assert "mpi4py" not in loaded["report"] | loaded.get("scan", set())
    assert "scan" not in loaded or "SurfaceTopography" in loaded["scan"]


def test_the_types_of_the_kernels_are_those_of_the_module() -> None:
    """`python tools/stub.py` writes them."""
    assert stub() == (ROOT / "adhesis" / "solver" / "_kernels.pyi").read_text()
