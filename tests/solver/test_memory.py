"""Freed memory is kept."""

from __future__ import annotations

import subprocess
import sys

import pytest

from adhesis.solver.runtime.malloc import keep_freed

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
    done = subprocess.run([sys.executable, "-c", work], capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.skipif(not keep_freed(), reason="the C library is not glibc")
def test_freed_memory_is_not_asked_for_again() -> None:
    assert faults(keep=False) > 10_000
    assert faults(keep=True) < 100
