"""What the mechanics ask of the process: one thread of linear algebra, and memory that is kept."""

import sys

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from adhesis.solver.runtime.malloc import keep_freed
from adhesis.solver.sharp.continuation.descent import leaving_step
from tests.support.processes import ran


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


WORK = """
import resource
import numpy as np
from adhesis.solver.runtime.malloc import keep_freed
KEEP
def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(10):
        arrays = [np.ones(250_000) for _ in range(10)]
        del arrays
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
faults()
print(faults())
"""


def faults(keep: bool) -> int:
    """Pages that ten rounds of twenty megabytes, taken and freed, ask of the system."""
    work = WORK.replace("KEEP", "keep_freed()" if keep else "")
    return int(ran(sys.executable, "-c", work, check=True).stdout)


@pytest.mark.skipif(not keep_freed(), reason="the C library is not glibc")
def test_freed_memory_is_not_asked_for_again() -> None:
    assert faults(keep=False) > 10_000
    assert faults(keep=True) < 100
