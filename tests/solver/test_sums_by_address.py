"""The bits of a sum do not depend on where its arrays lie in memory.

LLVM goes through a loop without vectors where an array that it writes lies less than a few vectors
behind one that it reads. A sum in that loop would then be taken in another order.
"""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from adhesis.solver.runtime import jit
from adhesis.solver.sharp.field.cluster_tree import _interpolate
from adhesis.solver.sharp.gap.conformal_map import map_gaps

SOLVER = Path(jit.__file__).resolve().parent.parent
ANY_ORDER = {"compiled_sums", "compiled_finite_sums"}
FAR = 100  # numbers between two arrays


def interpolation(rank: int, between: int) -> np.ndarray:
    """Interpolate from Chebyshev nodes that lie so many numbers before the result."""
    t = np.pi * (rank - np.arange(rank) - 0.5) / rank
    theta = np.array([0.7, 1.0, 1.3])
    memory = np.zeros(rank + between + theta.size * rank)
    node, out = memory[:rank], memory[rank + between :]
    node[:] = np.cos(t)
    row = map_gaps(np.array([[0.5, 1.5], [2.0, 3.0]]))[0]
    share = np.sin(t) * (-1.0) ** np.arange(rank)
    _interpolate(row, node, share, theta, np.ones(theta.size), out)
    return out


@pytest.mark.parametrize("rank", [8, 11, 20])
def test_an_interpolation_has_the_same_bits_wherever_it_is_written(rank: int) -> None:
    far = interpolation(rank, FAR)
    for between in range(32):
        assert interpolation(rank, between).tobytes() == far.tobytes()


def sums_and_writes(loop: ast.For) -> bool:
    """Whether a loop adds to a variable that is not its own, and writes to an array."""
    steps = [step for line in loop.body for step in ast.walk(line)]
    made = [one for step in steps if isinstance(step, ast.Assign) for one in ast.walk(step)]
    own = {one.id for one in made if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
    changed = [step.target for step in steps if isinstance(step, ast.AugAssign)]
    written = [target for step in steps if isinstance(step, ast.Assign) for target in step.targets]
    sums = any(isinstance(one, ast.Name) and one.id not in own for one in changed)
    return sums and any(isinstance(one, ast.Subscript) for one in [*changed, *written])


def loops_that_sum_and_write(source: str) -> list[str]:
    """Return the innermost such loops of functions that take sums in any order."""
    found = []
    for function in ast.parse(source).body:
        if not isinstance(function, ast.FunctionDef):
            continue
        names = {one.id for one in function.decorator_list if isinstance(one, ast.Name)}
        for loop in ast.walk(function) if names & ANY_ORDER else ():
            inner = [one for one in ast.walk(loop) if isinstance(one, ast.For | ast.While)]
            if isinstance(loop, ast.For) and inner == [loop] and sums_and_writes(loop):
                found.append(f"{function.name}, line {loop.lineno}")
    return found


def test_no_loop_that_sums_in_any_order_writes_to_an_array() -> None:
    example = """
@compiled_sums
def wrong(a, out):
    total = 0.0
    for i in range(a.size):
        out[i] = a[i]
        total += a[i]
"""
    assert loops_that_sum_and_write(example) == ["wrong, line 5"]
    paths = sorted(SOLVER.rglob("*.py"))
    found = {path.name: loops_that_sum_and_write(path.read_text()) for path in paths}
    assert {name: loops for name, loops in found.items() if loops} == {}
