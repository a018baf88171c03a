"""Compilation is logged when it takes longer than a second."""

from __future__ import annotations

import logging
import subprocess
import sys

import pytest

from adhesis.solver.runtime.compile_log import _CompileLogger, silence_compile_log
from adhesis.solver.runtime.jit import Compilation


def compiling(seconds: float) -> None:
    """Report so many seconds of compilation, one function each half second."""
    logger = _CompileLogger()
    for i in range(round(2 * seconds) + 1):
        seen = Compilation()
        seen.functions, seen.seconds = i, i / 2
        logger(seen)


def test_a_minute_is_logged_and_half_a_second_is_not(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "adhesis")
    compiling(0.5)
    assert caplog.messages == []
    compiling(60)
    assert "once, which takes one to two minutes" in caplog.messages[0]
    assert caplog.messages[1] == "compiling: 22 functions in 11 s"
    assert len(caplog.messages) == 6  # no silence above ten seconds
    assert {record.levelname for record in caplog.records} == {"WARNING"}


def test_callers_that_report_silence_the_log(caplog: pytest.LogCaptureFixture) -> None:
    with silence_compile_log():
        compiling(60)
    assert caplog.messages == []


def test_a_first_compilation_of_the_library_is_logged() -> None:
    program = """
import numba
from adhesis import HalfSpace, Problem, make_method, single_wave
from adhesis.solver.runtime import compile_log
compile_log._FIRST_AFTER = 0.0
make_method("sharp", Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01))
numba.njit(lambda x: x + 1)(1)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stderr.startswith("compiling for "), done.stderr
