"""Compiled functions are kept by all that their machine code depends on, and by nothing else."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
import shutil
import sys
import types
import warnings
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from adhesis.solver.runtime import disk_cache as code_cache
from adhesis.solver.runtime import jit as module
from adhesis.solver.runtime.disk_cache import CodeFiles, folder_name, kernel_modules

SOLVER = Path(module.__file__).resolve().parent.parent


def double(x):
    return 2 * x


def name_of(package: Path, **settings: str) -> str:
    return folder_name({"numba": "1", **settings}, "a-processor", package)


@pytest.fixture
def copy(tmp_path):
    """A copy of the solver's sources, to be edited."""
    shutil.copytree(SOLVER, tmp_path / "solver", ignore=shutil.ignore_patterns("__*__"))
    return tmp_path / "solver"


@pytest.fixture
def places(tmp_path, monkeypatch):
    """The installation's and the user's folder, both empty; code is kept there from now on."""
    monkeypatch.setattr(code_cache, "installed_folder", lambda: tmp_path / "installed")
    monkeypatch.setenv("ADHESIS_CACHE", str(tmp_path / "user"))
    use_new_files(monkeypatch)
    return tmp_path / "installed", tmp_path / "user"


def use_new_files(monkeypatch):
    """As a new process would: folders are looked at again."""
    files = CodeFiles("key"), CodeFiles("key", to_installation=True)
    monkeypatch.setattr(module, "code_files", lambda to_installation=False: files[to_installation])


def compile_double() -> int:
    """Number of functions compiled to call ``double`` in what might be a new process."""
    with module.watch_compilation() as seen:
        assert module.compiled(double)(21) == 42
    return seen.functions


# ------------------------------------------------------------------------------- the name


def test_an_edit_of_a_kernel_gives_another_folder_wherever_it_lies(copy):
    names = {name_of(copy)}
    for path in kernel_modules(copy):
        path.write_text(path.read_text() + "\n")
        names.add(name_of(copy))
    assert len(names) == len(kernel_modules(copy)) + 1


def test_a_kernel_that_moves_gives_another_folder(copy):
    before = name_of(copy)
    (copy / "grid" / "kernels.py").rename(copy / "sharp" / "kernels.py")
    assert name_of(copy) != before


def test_an_edit_elsewhere_compiles_nothing(copy):
    before = name_of(copy)
    kernels = kernel_modules(copy)
    for path in copy.rglob("*.py"):
        if path not in kernels:
            path.write_text(path.read_text() + "\n")
    assert name_of(copy) == before
    assert {"loop.py", "profile.py", "method.py"}.isdisjoint(path.name for path in kernels)


def test_settings_and_processor_have_a_folder_each(copy, monkeypatch):
    assert name_of(copy) != name_of(copy, opt="2")
    assert name_of(copy) != folder_name({"numba": "1"}, "another", copy)
    seen = {str(module.settings())}
    for name, value in (("OPT", 0), ("LOOP_VECTORIZE", 0), ("SLP_VECTORIZE", 1), ("ENABLE_AVX", 7)):
        monkeypatch.setattr(module.config, name, value)
        seen.add(str(module.settings()))
    monkeypatch.setattr(module.config, "CPU_FEATURES", "+nothing")
    seen.add(str(module.settings()))
    assert len(seen) == 6
    assert module.settings()["using_svml"] == "0"


def _modules() -> list[types.ModuleType]:
    found = pkgutil.walk_packages([str(SOLVER)], "adhesis.solver.")
    return [importlib.import_module(entry.name) for entry in found]


def test_compiled_code_reads_nothing_but_kernel_modules():
    """What a compiled function finds under a global name is part of its code: it must be keyed."""
    kernels = set(kernel_modules())
    functions = {
        value.py_func
        for each in _modules()
        for value in vars(each).values()
        if isinstance(value, Dispatcher)
    }
    assert len(functions) > 40
    for function in functions:
        home = importlib.import_module(function.__module__)
        assert _source(home) in kernels
        defined = _assigned(home)
        for name in function.__code__.co_names:
            value = function.__globals__.get(name)
            if value is None or isinstance(value, (types.ModuleType, type)):
                continue
            if isinstance(value, Dispatcher):
                origin = importlib.import_module(value.py_func.__module__)
                assert _source(origin) in kernels
            elif name not in defined:
                origin = importlib.import_module(_imported(home)[name])
                assert _source(origin) in kernels, (function.__name__, name)
                assert name in _assigned(origin)


def _source(home: types.ModuleType) -> Path:
    return Path(str(home.__file__)).resolve()


def _assigned(home: types.ModuleType) -> set[str]:
    tree = ast.parse(Path(str(home.__file__)).read_text())
    targets = [n for statement in tree.body for n in ast.walk(statement)]
    return {n.id for n in targets if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


def _imported(home: types.ModuleType) -> dict[str, str]:
    tree = ast.parse(Path(str(home.__file__)).read_text())
    return {
        alias.asname or alias.name: str(statement.module)
        for statement in tree.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }


# ------------------------------------------------------------------------------- the places


def test_code_is_compiled_once_and_kept_in_the_users_folder(places, monkeypatch):
    installed, user = places
    assert compile_double() == 1
    use_new_files(monkeypatch)
    assert compile_double() == 0
    assert len(list((user / "key").iterdir())) == 1
    assert not installed.exists()


def test_the_installation_is_looked_at_first_and_never_written_by_a_run(places, monkeypatch):
    installed, user = places
    with module.kept_in_installation():
        assert compile_double() == 1
    before = sorted((path, path.stat().st_mtime_ns) for path in installed.rglob("*"))
    use_new_files(monkeypatch)
    assert compile_double() == 0
    assert module.compiled(double)(1.5) == 3.0  # a signature that the installation has not
    assert len(list((user / "key").iterdir())) == 1
    after = sorted((path, path.stat().st_mtime_ns) for path in installed.rglob("*"))
    assert after == before


def test_an_installation_that_cannot_be_written_is_no_reason_to_complain(
    places, monkeypatch, tmp_path
):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(code_cache, "installed_folder", lambda: tmp_path / "file" / "beneath")
    use_new_files(monkeypatch)
    with warnings.catch_warnings(), module.kept_in_installation():
        warnings.simplefilter("error")
        assert compile_double() == 1
    assert len(list((places[1] / "key").iterdir())) == 1


def test_a_folder_that_cannot_be_used_is_one_warning(places, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ADHESIS_CACHE", str(tmp_path / "file" / "beneath"))
    use_new_files(monkeypatch)
    with pytest.warns(RuntimeWarning, match=r"cannot be kept.*file/beneath"):
        assert compile_double() == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert compile_double() == 1


@pytest.mark.parametrize("damage", ["cut", "one bit"])
def test_a_damaged_file_is_compiled_anew(places, monkeypatch, damage):
    compile_double()
    (kept,) = (places[1] / "key").iterdir()
    content = bytearray(kept.read_bytes())
    if damage == "cut":
        del content[100:]
    else:
        content[len(content) // 2] ^= 4
    kept.write_bytes(content)
    use_new_files(monkeypatch)
    assert compile_double() == 1
    assert compile_double() == 0


@pytest.mark.parametrize(
    ("variables", "wanted"),
    [
        ({"ADHESIS_CACHE": "/own", "XDG_CACHE_HOME": "/xdg"}, "/own"),
        ({"XDG_CACHE_HOME": "/xdg"}, "/xdg/adhesis"),
        ({"HOME": "/home/somebody"}, "/home/somebody/.cache/adhesis"),
    ],
)
def test_the_users_folder(monkeypatch, variables, wanted):
    for name in ("ADHESIS_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert code_cache.users_folder() == Path(wanted)


def test_kept_code_gives_the_same_bits(places, monkeypatch):
    from adhesis.solver.grid.kernels import dot

    a, b = np.random.default_rng(1).standard_normal((2, 1001))
    fresh = module.compiled_finite_sums(dot.py_func)
    first = fresh(a, b)
    use_new_files(monkeypatch)
    with module.watch_compilation() as seen:
        again = module.compiled_finite_sums(dot.py_func)(a, b)
    assert (seen.functions, again) == (0, first)


def inner(x):
    return x + 1


def outer(x):
    return 2 * inner(x)


@pytest.mark.parametrize("lost", [False, True], ids=["kept", "lost"])
def test_code_that_is_called_and_not_copied_comes_with_its_caller(places, monkeypatch, lost):
    """And if it is missing, or another process has put other code there, both are compiled anew."""
    monkeypatch.setattr(module, "_LONGEST_COPIED", 0)
    plain, here = inner, sys.modules[__name__]

    def call() -> int:
        use_new_files(monkeypatch)
        monkeypatch.setattr(here, "inner", module.compiled(plain))
        with module.watch_compilation() as seen:
            assert module.compiled(outer)(4) == 10
        return seen.functions

    assert call() == 2
    if lost:
        (callee,) = (places[1] / "key").glob("*.inner-*")
        callee.unlink()
    assert call() == (2 if lost else 0)
    assert call() == 0


def test_numbers_in_a_call_make_no_code_of_their_own(places, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "inner", module.compiled(inner))
    ahead = module.compiled(lambda: inner(1) + inner(2))
    assert ahead() == 5
    assert len(inner.inner.signatures) == 1


# ------------------------------------------------------------------------- what is not compiled


def put(values: np.ndarray, part: np.ndarray) -> float:
    values[: part.size] = part
    values[:2] = part
    return values[0]


def test_assigning_to_a_slice_compiles_no_strings_and_still_refuses_other_shapes(places):
    with module.watch_compilation() as seen:
        function = module.compiled(put)
        assert function(np.zeros(3), np.ones(2)) == 1.0
    assert seen.functions < 10  # with numba's own message 40 more
    with pytest.raises(ValueError, match="another shape"):
        function(np.zeros(5), np.ones(3))


def test_only_what_python_calls_can_be_called_from_python(places):
    called = module.compiled(double)
    caller = module.compiled(lambda x: called(x) + 1)
    assert caller(1.5) == 4.0
    assert not called.overloads  # its code for compiled callers unpacks no objects
    assert called(1.5) == 3.0
    both = module.compiled_for_both(double)
    assert both.inner is both


# ------------------------------------------------------------------------------- references


def sum_of_squares(a):
    total = 0.0
    for i in range(a.shape[0]):
        row = a[i, 1:].reshape(a.shape[1] - 1)
        for j in range(row.shape[0]):
            total += row[j] * row[j]
    return total


def last_row(a):
    return a[-1]


def last_row_and_its_double(a):
    return a[-1], 2 * a[-1]


def sum_of_chosen(a):
    return a[a[:, 0] > 0].sum()


def sum_of_doubled(a):
    rows = a[1:]
    doubled = 2 * rows
    return doubled.sum() + rows.sum()


def sum_of_view_of_doubled(a):
    row = (2 * a)[1]  # keeps the doubled array, which no name keeps
    other = np.ones(a.shape[1])
    return row.sum() + other.sum()


def sum_of_last(a):
    last = a
    for i in range(a.shape[0]):
        if a[i, 0] > 1:
            last = a[i:] + i  # sometimes the argument, sometimes made here
    return last.sum()


@pytest.mark.parametrize(
    ("function", "counts"),
    [
        (sum_of_squares, set()),
        (last_row, {"NRT_incref"}),
        (last_row_and_its_double, {"NRT_incref"}),
        (sum_of_chosen, {"NRT_decref"}),
        (sum_of_doubled, {"NRT_decref"}),
        (sum_of_view_of_doubled, {"NRT_decref"}),
        (sum_of_last, {"NRT_incref", "NRT_decref"}),
    ],
)
def test_references_are_counted_of_arrays_that_are_made_or_returned(places, function, counts):
    compiled = module.compiled_for_both(function)
    given = np.arange(6.0).reshape(3, 2)
    wanted = np.array(function(given))
    before = sys.getrefcount(given)
    result = compiled(given)
    np.testing.assert_array_equal(result, wanted)
    if function not in (last_row, last_row_and_its_double):
        assert sys.getrefcount(given) == before
    del given
    np.testing.assert_array_equal(result, wanted)
    inner = module.compiled(function).inner  # without the unpacking of objects
    inner.compile(compiled.signatures[0])
    (code,) = inner.inspect_llvm().values()
    assert set(re.findall(r"call void @(NRT_[id][ne]cref)", code)) == counts
