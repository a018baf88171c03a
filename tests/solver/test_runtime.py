"""What the mechanics ask of the process: one thread of linear algebra."""

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from adhesis.solver.sharp.continuation.descent import leaving_step


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
