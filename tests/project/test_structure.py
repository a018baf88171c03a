"""The rules of packages, read from the import statements and from what a process has loaded.

A folder is a unit; in a folder that has folders inside, each module is a unit of its own.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.support.campaign_support import environment
from tests.support.synthetic_results import campaign, rows, text_of, write

ROOT = Path(__file__).resolve().parent.parent.parent
PACKAGES = {"adhesis": "adhesis", "adhesis.solver": "solver", "adhesis.ensemble": "ensemble"}
FOLDERS = (*PACKAGES.values(), "tests")

# The only modules that import what is slow to load: MPI, the file format, the compiler, figures.
MPI = {"adhesis.ensemble.run.ranks", "adhesis.ensemble.doctor.probe"}
HDF5 = {
    "adhesis.ensemble.results.disk_file",
    "adhesis.ensemble.loop.sealed_file",
    "adhesis.ensemble.results.merge",
    "adhesis.ensemble.results.head",
    "adhesis.ensemble.results.layout",
    "adhesis.ensemble.results.read",
    "adhesis.ensemble.results.write",
    "adhesis.ensemble.run.session",
    "adhesis.ensemble.doctor.probe",
    "adhesis.ensemble.versions",
}
COMPILED = {"adhesis.solver.runtime.compiler", "adhesis.solver.runtime.jit"}
FIGURES = {
    "adhesis.ensemble.loop.loop_figure",
    "adhesis.ensemble.loop.film",
    "adhesis.ensemble.bench.bench_figure",
    "adhesis.ensemble.report.figures.shapes_and_spectra",
    "adhesis.ensemble.report.figures.loops",
    "adhesis.ensemble.report.figures.loss_figures",
    "adhesis.ensemble.report.figures.style",
    "adhesis.ensemble.report.plots",
    "adhesis.ensemble.trace.figures",
}
IMPORTERS = {"mpi4py": MPI, "h5py": HDF5, "numba": COMPILED, "matplotlib": FIGURES}

# What the mechanics know nothing of.
NOT_IN_SOLVER = {
    "h5netcdf",
    "h5py",
    "matplotlib",
    "mpi4py",
    "multiprocessing",
    "rich",
    "subprocess",
    "threading",
    "xarray",
}
# The mechanics start no threads for their work: one module keeps the handlers of signals out of the
# compiler, the other has locks against the threads of callers.
THREADING = {"adhesis.solver.runtime.uninterrupted", "adhesis.solver.runtime.threads"}


def modules() -> Iterator[tuple[str, Path]]:
    for package, folder in PACKAGES.items():
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = (package, *path.relative_to(ROOT / folder).with_suffix("").parts)
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


PATHS = dict(modules())


@cache
def imported(path: Path) -> frozenset[str]:
    """Every module that a file imports, at its top, inside functions or for types only."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in PATHS else str(node.module))
    return frozenset(found)


@cache
def imports() -> dict[str, set[str]]:
    """Return what each module imports; every file is parsed once, and not while tests are found."""
    return {name: imported(path) for name, path in PATHS.items()}


def unit(module: str) -> str:
    folder = PATHS[module].parent
    if any((other / "__init__.py").exists() for other in folder.iterdir()):
        return module
    return module if PATHS[module].name == "__init__.py" else module.rpartition(".")[0]


def units() -> dict[str, set[str]]:
    """Return what each unit imports of others."""
    arrows: dict[str, set[str]] = {}
    for module, names in imports().items():
        here = arrows.setdefault(unit(module), set())
        here |= {unit(name) for name in names if name in PATHS} - {unit(module)}
    return arrows


def circle(arrows: Mapping[str, set[str]]) -> list[str]:
    """Return the members of one circle, or an empty list."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_the_statements_are_seen_wherever_they_stand(tmp_path: Path) -> None:
    path = tmp_path / "a.py"
    path.write_text(
        "import numpy.linalg\nfrom typing import TYPE_CHECKING\n"
        "from adhesis.solver.loading import loop\n"
        "if TYPE_CHECKING:\n    from h5py import File\ndef f():\n    import mpi4py.MPI as M\n"
    )
    expected = {"numpy.linalg", "typing", "adhesis.solver.loading.loop", "h5py", "mpi4py.MPI"}
    assert imported(path) == expected
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}})
    assert len(PATHS) > 80


def test_no_circle_of_modules() -> None:
    assert circle({m: {n for n in names if n in PATHS} for m, names in imports().items()}) == []


def test_no_circle_of_units() -> None:
    assert circle(units()) == []


def test_mechanics_know_nothing_of_campaigns_ranks_and_files() -> None:
    for module, names in imports().items():
        if module.startswith("adhesis.solver"):
            assert all(n.startswith("adhesis.solver") for n in names if n.startswith("adhesis"))
            found = {name.split(".")[0] for name in names} & NOT_IN_SOLVER
            assert found == ({"threading"} if module in THREADING else set()), module


@pytest.mark.parametrize("package", IMPORTERS)
def test_what_is_slow_to_load_is_imported_by_few_modules(package: str) -> None:
    importers = {
        module
        for module, names in imports().items()
        if package in {name.split(".")[0] for name in names}
    }
    assert importers == IMPORTERS[package]


@pytest.mark.parametrize(
    "folder",
    sorted({p.parent for top in FOLDERS for p in (ROOT / top).rglob("*.py")}),
    ids=lambda folder: str(folder.relative_to(ROOT)),
)
def test_every_folder_says_what_lives_there(folder: Path) -> None:
    """In a sentence, and in the code what may be imported from it; its init holds nothing else."""
    tree = ast.parse((folder / "__init__.py").read_text())
    words = ast.get_docstring(tree) or ""
    assert words.split("\n\n")[0].endswith("."), "no sentence"
    if folder.name != "adhesis":
        assert len(tree.body) == 1
        assert "Import" in words or "tests" in folder.relative_to(ROOT).parts


# ---------------------------------------------------------------------- what a process loads


def loaded(code: str, *words: str, blocked: str = "") -> set[str]:
    """Return the packages that a process has loaded after ``code``."""
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{code}\n"
            "print('\\nloaded', *{m.split('.')[0] for m in sys.modules})",
            *words,
        ],
        capture_output=True,
        text=True,
        check=False,
        env=environment(),
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split()[1:])


def test_the_public_package_loads_little() -> None:
    assert loaded("import mpi4py") >= {"mpi4py"}
    assert loaded("import adhesis") & {"mpi4py", "h5py", "matplotlib", "xarray", "rich"} == set()


COMMAND = "from adhesis.ensemble.command.main import main\nassert main(sys.argv[1:]) == 0"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    small = campaign(realisations=2)
    return write(tmp_path_factory.mktemp("structure") / "r.h5", small, rows(small))


def test_status_loads_no_mpi_and_no_figures(results: Path) -> None:
    packages = loaded(COMMAND, "status", str(results))
    assert packages & {"mpi4py", "matplotlib", "numba"} == set()


@pytest.mark.parametrize("options", [(), ("--dry-run",), ("--redo", "failed")])
def test_a_run_with_nothing_to_do_loads_no_solver(
    results: Path, tmp_path: Path, options: tuple[str, ...]
) -> None:
    path = tmp_path / "c.toml"
    path.write_text(text_of(realisations=2))
    settings = {"PMIX_MCA_gds": "hash", "PRTE_MCA_plm": "ssh", "HYDRA_LAUNCHER": "ssh"}
    command = f"import os; os.environ |= {settings}  # of a site, and not of a rank\n{COMMAND}"
    packages = loaded(command, "run", str(path), "--out", str(results), *options)
    assert packages & {"mpi4py", "matplotlib", "numba", "llvmlite", "scipy"} == set()


def test_report_loads_no_mpi(results: Path, tmp_path: Path) -> None:
    # Every figure is drawn; putting it on disk takes seconds and loads nothing of ours.
    quick = "import adhesis.ensemble.report.figures.style as s; s.save = lambda *_, **__: None\n"
    packages = loaded(quick + COMMAND, "report", str(results), "--to", str(tmp_path / "r"))
    assert "matplotlib" in packages
    assert "mpi4py" not in packages


def test_the_design_page_names_every_folder_and_every_file_that_it_names_is_there() -> None:
    page = (ROOT / "docs" / "design.md").read_text()
    picture = (ROOT / "docs" / "figures" / "structure.py").read_text()
    for folder in {path.parent for path in PATHS.values()} - {ROOT / p for p in PACKAGES.values()}:
        assert f"{folder.name}/" in page, folder
        if folder.parent in (ROOT / "solver", ROOT / "ensemble", ROOT / "solver" / "sharp"):
            assert f'"{folder.name}": (' in picture, folder
    known = {path.name for path in PATHS.values()}
    assert set(re.findall(r"`(\w+\.py)`", page)) - known == set()


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_what_a_benchmark_imports_is_there(path: Path) -> None:
    """No test runs most of them."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module != "__future__":
            exec(ast.unparse(node), {})  # raises ImportError


def test_nothing_imports_the_folders_by_their_bare_names() -> None:
    """A user's own ``solver.py`` or ``ensemble.py`` is another module."""
    places = [
        path
        for top in ("benchmarks", "docs", "examples", "jobs", "tests", "tools")
        for path in (ROOT / top).rglob("*.py")
    ]
    for path in (*PATHS.values(), *places):
        assert {n.split(".")[0] for n in imported(path)} & {"solver", "ensemble"} == set(), path


def test_no_program_takes_abbreviated_options() -> None:
    """A new option may make an abbreviation ambiguous that scripts use."""
    programs = [
        path
        for top in ("benchmarks", "docs", "examples", "tools")
        for path in (ROOT / top).rglob("*.py")
    ]
    for path in (*PATHS.values(), *programs):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and (
                ast.unparse(node.func).endswith(("ArgumentParser", ".add_parser"))
            ):
                given = {word.arg: ast.unparse(word.value) for word in node.keywords}
                assert given.get("allow_abbrev") == "False", f"{path}:{node.lineno}"
