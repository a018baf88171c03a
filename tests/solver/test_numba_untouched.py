"""A user's own compiled functions are what they are without adhesis: code, messages, results."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np

from adhesis.solver.runtime.compiler import Compiler

ROOT = Path(__file__).resolve().parents[2]
# Functions that meet all that adhesis changes for its own: boxing of arrays and named tuples, the
# refusal of a slice of another shape, references to arrays, and functions that numba makes itself.
OWN = """
import sys
from collections import namedtuple

import numba
import numba.np.arrayobj
import numpy as np

sys.path.insert(0, sys.argv[1])
Pair = namedtuple("Pair", "first second")


def make():
    @numba.njit
    def assign(target, source):
        target[:] = source
        return target

    @numba.njit
    def pair(values):
        return Pair(values[1:], values.sum())

    @numba.njit
    def views(values):
        part = values[1:].reshape(2, 2)
        total = np.dot(part, part)
        return part, np.sort(total.ravel()), np.concatenate((values, values))

    return assign, pair, views


def answers(functions):
    assign, pair, views = functions
    x = np.arange(5.0)
    out = [repr(assign(x.copy(), x)), repr(pair(x)), repr(views(x))]
    try:
        assign(x.copy(), x[:2])
    except ValueError as error:
        out.append(str(error))
    return out, [code for f in functions for code in f.inspect_llvm().values()]


answers(make())  # numba itself fills its tables at the first compilation
BEFORE = {}
for name, table in (
    ("boxers", numba.core.pythonapi._boxers.functions),
    ("arrays", vars(numba.np.arrayobj)),
    ("lowering", vars(numba.core.lowering.Lower)),
    ("compiler", vars(numba.core.compiler.Compiler)),
):
    BEFORE[name] = (table, dict(table))
"""
ADHESIS = """
import adhesis

problem = adhesis.Problem(adhesis.single_wave(1e-6, 1e-3), adhesis.HalfSpace(1e6, 0.5), 0.01)
for name in ("sharp", "grid"):
    adhesis.run_loop(adhesis.make_method(name, problem), max_penetration=0.5, load_steps=4)
from adhesis.solver.runtime.compiler import Compiler

@numba.njit(pipeline_class=Compiler)
def kernel(target, source):
    target[1:] = source
    return target

a = np.zeros(4)
try:
    kernel(a, np.ones(2))
except ValueError as error:
    has_long_one = hasattr(numba.np.arrayobj, "raise_with_shape_context")
    ours = "cannot assign a slice from an array of another shape"
    assert (str(error) == ours) == has_long_one, error
"""
PRINT = """
texts, codes = answers(make())
for name, (table, was) in BEFORE.items():
    assert all(table[key] is value for key, value in was.items()), name
print("\\n".join(texts))
print("CODE")
print("\\n".join(codes))
"""


def printed(*parts: str) -> tuple[str, str]:
    """Return what a program prints: its results, and the code of its functions."""
    done = subprocess.run(
        [sys.executable, "-c", "".join(parts), str(ROOT)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    texts, _, code = done.stdout.partition("CODE\n")
    return texts, code


def comparable(code: str) -> list[str]:
    """Return the code without what each process has its own of: addresses, numbers, class names."""
    code = re.sub(r"(?m)^@\.const\.pickledata.*$", "", code)
    code = re.sub(r"(?m)^(?:; ModuleID|source_filename).*$", "", code)
    code = re.sub(r"-?\b\d{7,}\b|0x[0-9a-f]+", "ADDRESS", code)
    code = re.sub(r"B\d+c\d+\w*|v\d+B|\.\d+\b|\$\d+|%\d+|abi:v\d+|[0-9A-Za-z_]{40,}", "", code)
    return code.splitlines()


def test_a_function_of_a_user_is_as_without_adhesis() -> None:
    """It gives the same answers by the same code; boxing shows in the code alone."""
    alone, beside = printed(OWN, PRINT), printed(OWN, ADHESIS, PRINT)
    assert "cannot assign slice" in alone[0]  # numba's own message, of any version
    assert beside[0] == alone[0]
    code = comparable(beside[1])
    assert len(code) > 500
    assert code == comparable(alone[1])


def test_results_of_our_own_functions_are_boxed_without_python_code() -> None:
    """The other side: what the tables no longer hold is still done for our own."""

    @numba.njit(pipeline_class=Compiler)
    def kernel(values):
        return values[1:]

    calls = []
    sys.setprofile(lambda frame, event, _: calls.append((event, frame.f_code.co_name)))
    try:
        kernel(np.arange(3.0))  # compiled and loaded
        calls.clear()
        kernel(np.arange(3.0))
    finally:
        sys.setprofile(None)
    assert {name for event, name in calls if event == "call"} <= {"kernel"}
