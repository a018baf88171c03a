"""Compiling that makes one wait who runs a loop from Python is told; a moment of it is not."""

from __future__ import annotations

import logging

import pytest

from adhesis.solver.runtime.compile_log import _Teller, hushed
from adhesis.solver.runtime.jit import Compilation


def compiling(seconds: float) -> None:
    """What the compiler tells of so many seconds of work, a function each half second."""
    teller = _Teller()
    for i in range(round(2 * seconds) + 1):
        seen = Compilation()
        seen.functions, seen.seconds = i, i / 2
        teller(seen)


def test_a_moment_is_not_told_and_a_minute_is(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "adhesis")
    compiling(0.5)
    assert caplog.messages == []
    compiling(60)
    assert "once, in a minute or so" in caplog.messages[0]
    assert caplog.messages[1] == "compiling: 22 functions in 11 s"
    assert len(caplog.messages) == 6  # no silence above ten seconds
    assert {record.levelname for record in caplog.records} == {"WARNING"}


def test_who_compiles_ahead_tells_in_its_own_way(caplog: pytest.LogCaptureFixture) -> None:
    with hushed():
        compiling(60)
    assert caplog.messages == []
