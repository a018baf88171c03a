"""examples/measured_profile.py: from a measured trace to its loss, and the same by the command."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from matplotlib.image import imread

from ensemble.command.main import main

ROOT = Path(__file__).parent.parent.parent
SCRIPT = ROOT / "examples" / "measured_profile.py"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("measured_profile", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def losses(text: str) -> dict[str, float]:
    """Loss in mJ/m² by shortest wave, from the table that the script prints."""
    rows = re.findall(r"^ *((?:mirrored +)?[\d.]+) +\d+ +\S+e-\d\d +\S+ +([\d.]+) ", text, re.M)
    return {" ".join(label.split()): float(loss) for label, loss in rows}


def test_the_script_and_the_command_it_names_give_the_loss_of_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    done = subprocess.run(
        [sys.executable, SCRIPT],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    table = losses(done.stdout)
    assert list(table) == ["200", "100", "50", "25", "12.5", "6.25", "mirrored 12.5"]
    # The page shows what is printed, but for ambiguous jumps: a mirrored trace has many of them.
    page = (ROOT / "docs" / "measured-profile.md").read_text()
    told = losses(re.sub("^ {4}", "", page, flags=re.M))
    for label, loss in table.items():
        assert told[label] == pytest.approx(loss, rel=0.1 if "mirrored" in label else 0.02), label
    shares = [float(share) for share in re.findall(r" ([\d.]+)%$", done.stdout, re.M)]
    assert sum(shares) == pytest.approx(100, abs=0.5)  # of the table of jumps
    assert imread(tmp_path / "measured_profile.png").shape[0] > 100
    (command,) = re.findall(r"^adhesis (loop .*)$", done.stdout, re.M)
    words = shlex.split(command.replace("heights.csv", str(tmp_path / "heights.csv")))
    assert main([*words, "--quiet", "--json", str(tmp_path / "loop.json")]) == 0
    loop = json.loads((tmp_path / "loop.json").read_text())
    assert 1e3 * loop["loss"] == pytest.approx(table["6.25"], rel=1e-3)


def test_levelling_takes_the_tilt_and_nothing_else(example: ModuleType) -> None:
    x = np.linspace(0, 2e-3, 500)
    rough = 1e-6 * np.cos(2 * np.pi * 7 * (x - x.mean()) / 2e-3)
    np.testing.assert_allclose(
        example.levelled(x, rough + 3e-3 * x + 1e-3), rough - rough.mean(), atol=1e-12
    )


def test_closed_periods_have_no_step(example: ModuleType) -> None:
    z = np.linspace(-1.0, 1.0, 101) ** 3
    step = np.abs(np.diff(z)).max()
    for period in (example.mirrored(z), example.windowed(z, 0.2)):
        assert np.abs(np.diff(period, append=period[0])).max() < 3 * step
    np.testing.assert_array_equal(example.mirrored(z)[:101], z)
    assert example.mirrored(z).size == 200
    np.testing.assert_array_equal(example.windowed(z)[5:95], z[5:95])


def test_resampled_heights_hold_the_waves_below_the_cut_off(example: ModuleType) -> None:
    x = np.arange(400) / 400
    kept = np.cos(2 * np.pi * 3 * x) + 0.3 * np.sin(2 * np.pi * 20 * x)
    nodes = np.arange(41) / 41
    found = example.resampled(kept + np.cos(2 * np.pi * 21 * x), 20)
    expected = np.cos(2 * np.pi * 3 * nodes) + 0.3 * np.sin(2 * np.pi * 20 * nodes)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    profile = example.band_limited(kept, 2e-3, 1e-4)
    assert profile.highest_harmonic == 20
    np.testing.assert_allclose(profile.heights(400), kept, atol=1e-12)
    with pytest.raises(ValueError, match="do not hold"):
        example.resampled(kept, 200)


def test_uneven_steps_are_put_on_even_ones(example: ModuleType, tmp_path: Path) -> None:
    x = np.array([0.0, 1.0, 3.0, 2.0, 4.5, 6.0])
    example.write_trace(tmp_path / "t.csv", x, 2 * x)
    even, z = example.read_trace(tmp_path / "t.csv")
    np.testing.assert_allclose(np.diff(even), 1.2)
    np.testing.assert_allclose(z, 2 * even)
