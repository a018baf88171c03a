"""What the handler of a signal raises arrives as it is, wherever the signal comes."""

from __future__ import annotations

import ctypes
import importlib
import os
import pkgutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from adhesis.solver.precompile import COMPILED_METHODS, _small_loops, small_problem
from adhesis.solver.sharp.field.solution import LoadingDevice
from adhesis.solver.sharp.field.tree_factor import Charges
from numba import types
from numba.core import boxing, pythonapi, serialize
from numba.core.dispatcher import Dispatcher

import adhesis.solver
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.method import Method
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.registry import make_method
from adhesis.solver.runtime import compiler
from adhesis.solver.runtime import jit as compiled
from adhesis.solver.runtime.uninterrupted import uninterrupted
from tools.interrupted import Interrupt, interrupted

KERNELS = 20  # at least so many are called from Python
INTERRUPTS = 8  # of each method


def method(name: str) -> Method:
    if name == "grid":
        return make_method("grid", small_problem(0.04), nodes_per_wave=8)
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=4, seed=1, h_rms=1e-6)
    return make_method("sharp", Problem(profile, HalfSpace(young=1e6, poisson=0.5), 0.04))


@pytest.fixture(scope="module", params=["sharp", "grid"])
def chosen(request: pytest.FixtureRequest) -> Method:
    """A method for all loops of the test, each as it comes after another one."""
    return method(request.param)


@pytest.fixture
def alarm() -> Iterator[None]:
    def handler(number: int, frame: object) -> None:
        raise Interrupt

    before = signal.signal(signal.SIGALRM, handler)
    yield
    signal.signal(signal.SIGALRM, before)


def loss(chosen: Method) -> tuple[str, str]:
    loop = run_loop(chosen, max_penetration=0.8, load_steps=4)
    return loop.loss.hex(), loop.mean_stress.tobytes().hex()


# --------------------------------------------------------------------------- where code returns


def raises_signal() -> Callable[[int], int]:
    function = ctypes.CDLL(None)["raise"]
    function.argtypes, function.restype = [ctypes.c_int], ctypes.c_int
    return function


def njit(function: Callable[..., Any]) -> Any:
    """Compile a function as ours are."""
    return numba.njit(function, pipeline_class=compiler.Compiler)


NOW, ALARM = raises_signal(), int(signal.SIGALRM)


class Foreign(NamedTuple):
    """A named tuple of somebody else."""

    number: float


def array():
    NOW(ALARM)
    return np.ones(3)


def named_tuple():
    NOW(ALARM)
    return LoadingDevice(1.0, 2.0)


def nested():
    NOW(ALARM)
    return 1, (Charges(np.ones(2), np.ones((2, 2))), np.ones(1)), (2.0, True, None)


@pytest.mark.parametrize("function", [array, named_tuple, nested])
def test_a_signal_that_comes_in_compiled_code_is_handled_after_it_has_returned(alarm, function):
    """Boxing the result runs no Python code, in which the handler would be called."""
    kernel = njit(function)
    kernel.compile(())
    for _ in range(3):
        with pytest.raises(Interrupt):
            kernel()


def test_results_are_what_numba_makes_of_them():
    """The same classes and values, and named tuples that compiled code takes as such."""
    handed = njit(lambda pair, hold: (pair, hold, pair.isolated[1:] + 1))
    pair = Charges(np.arange(3.0), np.ones((3, 3)))
    back, hold, part = handed(pair, LoadingDevice(1.0, 2.0))
    assert (type(back), type(hold), type(part)) == (Charges, LoadingDevice, np.ndarray)
    assert (hold.separation_weight, hold.compliance, part.tolist()) == (1.0, 2.0, [2.0, 3.0])
    assert np.array_equal(back.isolated, pair.isolated)
    assert np.array_equal(back.potential_of_sibling, pair.potential_of_sibling)
    handed(back, hold)
    assert len(handed.signatures) == 1


def boxed_in_c(typ: Any) -> bool:
    """Whether boxing a result of this type runs C code alone."""
    box = compiler._BOXERS.get(type(typ)) or pythonapi._boxers.lookup(type(typ))
    if box in (boxing.box_tuple, compiler._box_named_tuple):
        of_ours = not isinstance(typ, types.BaseNamedTuple) or (
            typ.instance_class.__module__.startswith("adhesis.solver.")
        )
        return of_ours and all(boxed_in_c(item) for item in typ)
    if isinstance(typ, types.Optional):
        return boxed_in_c(typ.type)
    return box in (
        boxing.box_bool, boxing.box_integer, boxing.box_float, boxing.box_none, compiler._box_array
    )  # fmt: skip


def test_no_result_of_a_kernel_runs_python_code_while_it_is_boxed(monkeypatch):
    class Counted(dict):
        read = 0

        def __getitem__(self, key):
            Counted.read += 1
            return super().__getitem__(key)

    monkeypatch.setattr(serialize, "_unpickled_memo", Counted(serialize._unpickled_memo))
    for name in COMPILED_METHODS:
        _small_loops(name)  # they call all that loops and fields call
    assert Counted.read == 0
    results = {
        f"{function.__module__}.{function.__name__}": result.signature.return_type
        for entry in pkgutil.walk_packages(adhesis.solver.__path__, "adhesis.solver.")
        for function in vars(importlib.import_module(entry.name)).values()
        if isinstance(function, Dispatcher)
        for result in function.overloads.values()
    }
    assert len(results) >= KERNELS
    assert any(isinstance(typ, types.BaseNamedTuple) for typ in results.values())
    assert [name for name, typ in results.items() if not boxed_in_c(typ)] == []
    bad = (types.float64, types.NumberClass(types.int64)), (njit(lambda: Foreign(1.0)),)
    bad[1][0]()
    foreign = bad[1][0].nopython_signatures[0].return_type
    assert not any(boxed_in_c(types.Tuple((types.int64, typ))) for typ in (bad[0][1], foreign))


# ------------------------------------------------------------------------------ whole loops


def test_a_loop_that_is_interrupted_anywhere_ends_in_what_was_raised(chosen):
    """Or it is done; and the same method gives the same bits afterwards."""
    expected = loss(chosen)
    started = time.perf_counter()
    loss(chosen)
    taken = time.perf_counter() - started
    rng = np.random.default_rng(1)
    ended = [interrupted(lambda: loss(chosen), t) for t in rng.uniform(0, taken, INTERRUPTS)]
    assert set(ended) <= {"raised", "done"}
    assert loss(chosen) == expected


# ------------------------------------------------------------------- what is not interrupted


def test_work_that_is_not_to_be_interrupted_goes_on_while_the_caller_is(alarm):
    go, later = threading.Event(), threading.Event()
    seen: list[object] = []

    @uninterrupted
    def inner() -> None:
        seen.append("inner")

    @uninterrupted
    def work() -> None:
        os.kill(os.getpid(), signal.SIGALRM)
        assert go.wait(60)
        try:
            inner()  # nobody waits for the rest
        finally:
            seen.append("end")
            later.set()

    with pytest.raises(Interrupt):
        work()
    assert seen == []
    go.set()
    assert later.wait(60)
    assert seen == ["end"]
    inner()
    assert seen == ["end", "inner"]


def test_an_interrupt_that_meets_the_start_of_a_thread_arrives_as_itself(monkeypatch):
    """A signal may reach another thread, and its handler then runs though signals are held."""
    name = next(n for n in ("_start_joinable_thread", "_start_new_thread") if hasattr(threading, n))
    start = getattr(threading, name)

    def interrupted_start(*args, **options):
        start(*args, **options)
        while any(not thread.is_alive() for thread in threading.enumerate()):
            time.sleep(1e-3)  # until the thread has struck itself off those that begin
        raise Interrupt

    monkeypatch.setattr(threading, name, interrupted_start)
    with pytest.raises(Interrupt):
        uninterrupted(lambda: time.sleep(0.2))()


def test_uninterrupted_work_returns_and_raises_as_it_does_by_itself():
    @uninterrupted
    def divide(a: float, *, by: float) -> tuple[float, bool]:
        return a / by, threading.current_thread() is threading.main_thread()

    assert divide(6, by=3) == (2.0, False)
    with pytest.raises(ZeroDivisionError):
        divide(1, by=0)


def test_an_interrupt_while_code_is_loaded_is_not_taken_for_a_damaged_file(monkeypatch, tmp_path):
    def loads(content: bytes) -> None:
        raise Interrupt

    monkeypatch.setenv("ADHESIS_CACHE", str(tmp_path))
    files = compiled.CodeFiles("key")
    monkeypatch.setattr(compiled, "code_files", lambda to_installation=False: files)
    assert compiled.compiled(_double)(2) == 4
    monkeypatch.setattr(compiled.pickle, "loads", loads)
    with pytest.raises(Interrupt):
        compiled.compiled(_double)(2)


def _double(x):
    return 2 * x
