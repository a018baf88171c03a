"""examples/measured_profile.py: from a file to a page, and the same by the command."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from adhesis.ensemble.command.main import main

ROOT = Path(__file__).parent.parent.parent
SCRIPT = ROOT / "examples" / "measured_profile.py"


@pytest.mark.slow(reason="eighteen loops twice: as many as tests/ensemble/test_trace_answer.py")
def test_the_script_and_the_command_give_the_same_loss(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    done = subprocess.run(
        [sys.executable, SCRIPT, "--to", "out"],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (loss,) = re.findall(r"^loss +([\d.]+) ± [\d.]+ mJ/m²", done.stdout, re.M)
    assert "3 heights" in done.stdout
    assert (tmp_path / "out" / "trace.html").exists()
    trace = str(tmp_path / "out" / "trace.csv")
    contact = ["--work-of-adhesion", "0.04", "--young", "1e6", "--poisson", "0.5"]
    assert main(["trace", trace, *contact, "--to", str(tmp_path / "again"), "--quiet"]) == 0
    assert f"loss        {loss} ±" in capsys.readouterr().out
    found = json.loads((tmp_path / "again" / "trace.json").read_text())
    assert 1e3 * found["loss"]["value"] == pytest.approx(float(loss), abs=0.6)


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
