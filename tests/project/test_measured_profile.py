"""examples/measured_profile.py: from a file to a page, and the same by the command."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent


def test_the_made_up_measurement_is_read_as_it_was_made(tmp_path: Path) -> None:
    code = (
        "import sys; sys.path.insert(0, 'examples'); from pathlib import Path\n"
        "import measured_profile as m\n"
        f"m.write_made_up_measurement(Path({str(tmp_path / 't.csv')!r}))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
    from adhesis import prepare_trace, read_trace

    trace = read_trace(tmp_path / "t.csv")
    assert (trace.points, trace.drop_outs) == (2001, 3)
    assert trace.length == pytest.approx(2e-3)
    prepared = prepare_trace(trace)
    assert prepared.spectrum.noise == pytest.approx(5e-9, rel=0.1)
    assert 5e-6 <= prepared.cut_off < 10e-6
