"""examples/measured_profile.py: the measurement that it makes up is read as it was made."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from adhesis import prepare_trace, read_trace

SCRIPT = Path(__file__).parent.parent.parent / "examples" / "measured_profile.py"


def test_the_made_up_measurement_is_read_as_it_was_made(tmp_path):
    runpy.run_path(str(SCRIPT))["write_made_up_measurement"](tmp_path / "t.csv")
    trace = read_trace(tmp_path / "t.csv")
    assert (trace.points, trace.drop_outs) == (2001, 3)
    assert trace.length == pytest.approx(2e-3)
    prepared = prepare_trace(trace)
    assert prepared.spectrum.noise == pytest.approx(5e-9, rel=0.1)
    assert 5e-6 <= prepared.cut_off < 10e-6
