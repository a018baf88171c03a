"""What a process loads; that what benchmarks import is there.

The rules of imports are contracts of import-linter, in pyproject.toml.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.support.campaign_support import run_python
from tests.support.synthetic_results import campaign, rows, text_of, write
from tools.stub import stub

ROOT = Path(__file__).resolve().parent.parent.parent
COMMANDS = """
import os, sys
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
campaign, results, report = sys.argv[1:]
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
import mpi4py
"""


def test_a_command_loads_no_more_than_it_needs(tmp_path: Path) -> None:
    """The settings are those of a site, and not of a rank."""
    small = campaign(realisations=2)
    results = write(tmp_path / "r.h5", small, rows(small))
    (tmp_path / "c.toml").write_text(text_of(realisations=2))
    done = run_python("-c", COMMANDS, tmp_path / "c.toml", results, tmp_path / "report")
    assert done.returncode == 0, done.stderr
    lines = (line.split() for line in done.stdout.splitlines() if line.startswith("loaded "))
    loaded = {stage: set(names) for _, stage, *names in lines}
    numeric = {"scipy", "matplotlib", "mpi4py"}
    assert loaded["help"] & (numeric | {"numpy", "h5py", "pandas", "rich"}) == set()
    assert loaded["adhesis"] & (numeric | {"h5py", "xarray", "rich"}) == set()
    assert loaded["nothing_to_do"] & numeric == set()
    assert "matplotlib" in loaded["report"]
    assert "mpi4py" not in loaded["report"]


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_what_a_benchmark_imports_is_there(path: Path) -> None:
    """No test runs most of them."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module != "__future__":
            exec(ast.unparse(node), {})  # raises ImportError


def test_the_types_of_the_kernels_are_those_of_the_module() -> None:
    """`python tools/stub.py` writes them."""
    assert stub() == (ROOT / "adhesis" / "solver" / "_kernels.pyi").read_text()
