"""The benchmark: runs in processes of their own, tables, figure, command."""

import math
from dataclasses import replace

import numpy as np
import pytest

import adhesis.ensemble.bench.benchmark as benchmarking
from adhesis.ensemble.bench.bench_figure import draw
from adhesis.ensemble.bench.benchmark import Line, benchmark, page
from adhesis.ensemble.bench.measure import Measurement, Run, measure
from adhesis.ensemble.bench.scenes import ONE_WAVE, SMALL_ROUGH, TWO_WAVES
from adhesis.ensemble.command.main import main
from adhesis.ensemble.run.launch import peak_bytes
from tests.support.campaign_support import table_of

REFERENCE = (1.0, "made up")


def line(method, setting, seconds, error) -> Line:
    measured = Measurement(seconds, 200.0, 190.0, 1.0 + error, 2.0, 1e-3, 10, 2, 1)
    return Line(Run(ONE_WAVE, method, setting, 10, 60.0), REFERENCE, measured)


def failed(method, setting, scene=ONE_WAVE) -> Line:
    run = Run(scene, method, setting, 10, 60.0)
    return Line(run, REFERENCE, Measurement(note="given up after 60 s"))


# A grid of first order whose time grows as 1/error².
GRID = [line("grid", 2**k, 4.0**k, 2.0**-k) for k in range(1, 5)]


def test_one_wave_is_measured_against_its_exact_loss():
    """In a process of its own: the memory of this one does not count."""
    ballast, error = np.ones(50_000_000), 1e-3  # 400 MB, touched
    measured = measure(Run(ONE_WAVE, "sharp", error, ONE_WAVE.load_steps, 60.0))
    assert measured.note == ""
    assert measured.loss == pytest.approx(ONE_WAVE.exact_loss, rel=error)
    assert abs(measured.audit_residual) < error
    assert 0 < measured.cpu_seconds < 30
    assert 20 < measured.megabytes_before <= measured.megabytes < 380 < peak_bytes() / 1e6
    assert ballast[0] == 1
    assert (measured.jumps, measured.patches) == (2, 1)
    assert measured.solutions > 10


def test_a_run_that_fails_becomes_a_note():
    refused = measure(Run(ONE_WAVE, "sharp", 7.0, 10, 60.0))
    assert refused.note.startswith("failed: ValueError: accuracy is 7.0")
    assert math.isnan(refused.loss)


def test_a_run_that_takes_too_long_is_given_up():
    assert measure(Run(SMALL_ROUGH, "grid", 4096, 20, 0.1)).note == "given up after 0.1 s"


def fake_measure(run: Run) -> Measurement:
    """One second and first order for the grid, exact for sharp."""
    error = {"grid": 1 / run.setting, "sharp": 0.0}[run.method]
    loss = run.scene.exact_loss or 3.0
    return Measurement(1.0, 200.0, 190.0, loss * (1 + error), 2.0, 1e-3, 10, 2, 1)


def test_a_grid_that_would_take_too_long_is_left_out_and_so_are_finer_ones(monkeypatch):
    def slow(run: Run) -> Measurement:
        return replace(fake_measure(run), cpu_seconds=20.0 if run.setting == 256 else 1.0)

    monkeypatch.setattr(benchmarking, "measure", slow)
    lines = list(benchmark([ONE_WAVE], seconds=60.0))
    notes = [line.measured.note[:8] for line in lines if line.run.method == "grid"]
    assert notes == ["", "", "left out", "left out"]
    assert all(line.measured.note == "" for line in lines if line.run.method != "grid")


def test_reference_is_the_tightest_run_that_finishes(monkeypatch):
    asked = []

    def tightest_fails(run: Run) -> Measurement:
        asked.append((run.setting, run.load_steps))
        return Measurement(note="failed") if run.setting < 1e-7 else fake_measure(run)

    monkeypatch.setattr(benchmarking, "measure", tightest_fails)
    lines = list(benchmark([SMALL_ROUGH], seconds=60.0))
    assert (1e-7, 40) in asked
    assert {line.reference for line in lines} == {(3.0, "sharp, accuracy 1e-07, 40 load steps")}


def test_page_has_every_run_and_says_what_did_not_finish():
    lines = [*GRID, failed("grid", 1024), line("sharp", 1e-3, 0.5, 1e-3)]
    text = page(lines, "a test")
    assert "| grid | 1024 nodes | – | – | – | – | – | – | given up after 60 s |" in text
    assert "| sharp | 1e-03 | 0.50 | 200 | 2 | +1.0e-03 | +1.0e-03 | 10 |" in text
    assert "Reference: made up." in text
    rows = [row for row in text.splitlines() if row.startswith("| grid")]
    assert {row.count("|") for row in rows} == {10}


def test_figure_has_a_panel_for_each_scene_even_if_nothing_finished():
    lines = [*GRID, line("sharp", 1e-6, 1.0, 0.0), failed("sharp", 1e-3, scene=TWO_WAVES)]
    figure = draw(lines)
    one, two = (axes for axes in figure.axes if axes.get_visible())
    assert [drawn.get_label() for drawn in one.lines] == ["grid", "sharp"]
    assert one.get_xlim() == two.get_xlim()
    assert not two.lines
    draw([failed("sharp", 1e-3)])


@pytest.mark.usefixtures("quick_figures")
def test_command_writes_table_records_and_figure(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(benchmarking, "measure", fake_measure)
    assert main(["bench", "--quick", "--to", str(tmp_path / "new")]) == 0
    written = {path.name for path in (tmp_path / "new").iterdir()}
    assert written == {"benchmark.csv", "benchmark.md", "benchmark.png", "benchmark.pdf"}
    rows = table_of(tmp_path / "new" / "benchmark.csv")
    assert {row["scene"] for row in rows} == {"one-wave", "two-waves", "rough-32"}
    assert float(rows[0]["error"]) == pytest.approx(1 / 64)
    assert "adhesis bench --quick" in (tmp_path / "new" / "benchmark.md").read_text()
    assert "### One wave" in capsys.readouterr().out
