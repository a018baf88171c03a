"""From Python, without variables of the environment, linear algebra uses one thread."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from scipy.linalg import cython_lapack  # noqa: F401  # a library of its own
from threadpoolctl import ThreadpoolController

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.registry import make_method
from adhesis.solver.runtime.threads import on_one_thread
from adhesis.solver.sharp.mechanics import EdgeMechanics
from tests.support.scenes import small_problem


def threads() -> set[int]:
    libraries = ThreadpoolController().select(user_api="blas").info()
    assert libraries
    return {library["num_threads"] for library in libraries}


def test_a_loop_and_its_fields_use_one_thread_and_leave_the_number_as_it_was(monkeypatch):
    seen: list[set[int]] = []
    solve, equilibrium = EdgeMechanics.field, EdgeMechanics.equilibrium

    def watched(original):
        def call(*args, **kwargs):
            if len(seen) < 3:
                seen.append(threads())
            return original(*args, **kwargs)

        return call

    monkeypatch.setattr(EdgeMechanics, "equilibrium", watched(equilibrium))
    with ThreadpoolController().limit(limits=2):
        if threads() != {2}:
            pytest.skip("this linear algebra has no threads")
        method, states = make_method("sharp", small_problem(0.04)), []
        run_loop(
            method,
            max_penetration=0.5,
            load_steps=1,
            on_state=lambda _, state: states.append(state),
        )
        assert seen == [{1}] * 3
        assert threads() == {2}
        seen.clear()
        monkeypatch.setattr(EdgeMechanics, "field", watched(solve))
        method.fields(max(states, key=lambda state: state.patches), 256)
        assert seen == [{1}]
        assert threads() == {2}


def test_two_loops_in_two_threads_have_the_bits_of_one_after_the_other():
    """Each limits the threads; the first one to end leaves the limit to the other."""

    def loss(work_of_adhesion: float) -> str:
        method = make_method("sharp", small_problem(work_of_adhesion))
        return run_loop(method, max_penetration=0.8, load_steps=4).loss.hex()

    works = [0.02, 0.03, 0.04, 0.05]
    expected = [loss(work) for work in works]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(loss, works)) == expected


def test_the_first_caller_to_leave_restores_nothing_while_another_is_at_work():
    @on_one_thread
    def shorter() -> set[int]:
        return threads()

    @on_one_thread
    def longer(pool: ThreadPoolExecutor) -> set[int]:
        assert pool.submit(shorter).result() == {1}
        return threads()

    with ThreadpoolController().limit(limits=2), ThreadPoolExecutor(1) as pool:
        if threads() != {2}:
            pytest.skip("this linear algebra has no threads")
        assert longer(pool) == {1}
        assert threads() == {2}
