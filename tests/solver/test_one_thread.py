"""From Python, without variables of the environment, linear algebra uses one thread."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.registry import make_method
from adhesis.solver.sharp.equilibrium.griffith import leaving_step
from tests.support.scenes import small_problem


def threads() -> set[int]:
    libraries = ThreadpoolController().select(user_api="blas").info()
    assert libraries
    return {library["num_threads"] for library in libraries}


def test_modes_at_a_saddle_are_of_one_thread_which_leaves_the_number_as_it_was(monkeypatch):
    """Others in the process have their threads, and the bits depend on none of it."""
    seen: list[set[int]] = []
    original = np.linalg.eigh

    def watched(matrix):
        seen.append(threads())
        return original(matrix)

    monkeypatch.setattr(np.linalg, "eigh", watched)
    saddle = np.diag([1.0, -2.0, 3.0])
    with ThreadpoolController().limit(limits=2):
        if threads() != {2}:
            pytest.skip("this linear algebra has no threads")
        step = leaving_step(saddle, np.ones(3), np.arange(3.0))
        assert step.tolist() == [0, 1, 0]
        assert seen == [{1}]
        assert threads() == {2}


def test_two_loops_in_two_threads_have_the_bits_of_one_after_the_other():

    def loss(work_of_adhesion: float) -> str:
        method = make_method("sharp", small_problem(work_of_adhesion))
        return run_loop(method, max_penetration=0.8, load_steps=4).loss.hex()

    works = [0.02, 0.03, 0.04, 0.05]
    expected = [loss(work) for work in works]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(loss, works)) == expected
