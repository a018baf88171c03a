"""A preload on the command line, of a trace and in campaigns."""

import json
import re

import h5py
import numpy as np
import pytest
from matplotlib.axes import Axes

import adhesis
from adhesis import Control, Problem, prepare_trace, read_trace, run_loop, single_wave
from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.command.main import main
from adhesis.ensemble.report import findings
from adhesis.ensemble.report.figures.catalogue import sections
from adhesis.ensemble.report.markdown_page import write_page
from adhesis.ensemble.report.tables import campaign_tables
from adhesis.ensemble.task.compute import Runner, make_problem
from adhesis.ensemble.trace import answer as answers
from adhesis.ensemble.trace.loops import Cycle, Loops, Run
from adhesis.ensemble.trace.loops import compute as compute_run
from adhesis.ensemble.trace.trace_page import page_text
from adhesis.solver.registry import make_method
from tests.support.campaign_support import campaign_text
from tests.support.options import SCENE, rough_loop
from tests.support.scenes import HALF_SPACE, loop_of, rough
from tests.support.synthetic_results import campaign, rows, write


def test_the_loop_of_a_machine_turns_at_the_preload(tmp_path):
    document, text, _ = rough_loop(tmp_path, "--preload", "0.5kPa")
    assert document["preload"] == 500.0
    assert document["preload_reached"] is True
    assert document["turning_stress"] == pytest.approx(500.0, rel=1e-8)
    assert document["turning_point"] == document["max_penetration"]
    units = document["provenance"]["units"]
    assert units["preload"] == units["turning_stress"] == "Pa"
    assert units["turning_point"] == "1"
    assert (
        f"turning at the preload of 0.5 kPa, at Δ/h_max = {document['turning_point']:.6g}" in text
    )
    stress = np.array(document["mean_stress"])[np.array(document["branch"]) == "loading"]
    assert stress.max() == stress[-1]
    table = ("--csv", str(tmp_path / "loop.csv"))
    several, *_ = rough_loop(tmp_path, "--preload", "0.5kPa,200Pa", *table)
    assert [turn["preload"] for turn in several["turns"]] == [200.0, 500.0]
    assert "preload (Pa)" in (tmp_path / "loop.csv").read_text().splitlines()[0]
    assert several["loss"] == pytest.approx(document["loss"], rel=1e-5)
    soft, text, _ = rough_loop(tmp_path, "--preload", "500", "--stiffness", "1e9")
    assert soft["turning_stress"] == pytest.approx(500.0, rel=1e-8)
    assert soft["loss"] > document["loss"]
    assert "held by 1e+09 Pa/m, turning at the preload of 0.5 kPa, at u_tot/h_max = " in text


def test_a_preload_that_is_not_reached_is_doubted(tmp_path, capsys):
    words = ("--preload", "500kPa", "--max-penetration", "0.6")
    document, text, errors = rough_loop(tmp_path, *words)
    assert document["preload_reached"] is False
    assert document["turning_point"] == 0.6
    assert "turning at Δ/h_max = 0.6, before the preload of 500 kPa is reached" in text
    assert "the preload of 500 kPa is not reached" in errors
    assert main([*SCENE, *words, "--strict"]) == 1
    capsys.readouterr()
    strong = ["0.05" if word == "0.005" else word for word in SCENE]
    assert main([*strong, "--preload", "9kPa", "--stiffness", "1e7"]) == 1
    assert "Pa, less than the preload" in capsys.readouterr().err


def test_the_loss_of_a_weight_says_so(tmp_path):
    document, text, _ = rough_loop(tmp_path, "--stiffness", "0", "--max-stress", "500")
    (line,) = (line for line in text.splitlines() if line.startswith("loss"))
    assert document["loss_note"] in line
    assert document["loss_note"].startswith("under a weight; it falls off at ")
    *before, last = (jump["energy_drop"] for jump in document["jumps"])
    assert document["loss_note"].endswith(
        f": drops before the fall {1e3 * sum(before):.3g} mJ/m², closed at the separation of the "
        f"fall {1e3 * (sum(before) + last):.3g} mJ/m²"
    )
    machine, text, _ = rough_loop(tmp_path, "--preload", "500")
    assert machine["loss_note"] == ""
    assert machine["loss"] > document["loss"]
    assert "under a weight" not in text


def test_a_trace_doubts_a_fall_and_takes_shares_of_the_drops_before_it():
    profile, gamma, stress = rough(3, 6, 4, period=1e-3), 0.012, 2000.0
    cycle = Cycle(HALF_SPACE, (gamma,), (stress,), load_steps=5, control=Control(0.0))
    found = compute_run(Run("answer", profile, cycle, gamma, stress))
    problem = Problem(profile, HALF_SPACE, gamma, Control(0.0))
    loop = loop_of(problem, "auto", max_stress=stress, load_steps=5)
    assert loop.fall_warnings()[0] in found["warnings"] == list(loop.warnings)
    small = sum(jump.energy_drop for jump in loop.jumps[:-1] if jump.small_scale)
    before = sum(jump.energy_drop for jump in loop.jumps[:-1])
    assert found["small_scale_share"] == pytest.approx(small / before)


def test_a_surface_that_is_flat_enough_to_stick_says_so(tmp_path):
    words = ("--h-rms", "0.2um", "--preload", "0.5kPa")
    document, text, _ = rough_loop(tmp_path, *words)
    full = document["full_contact_energy"]
    assert full < document["work_of_adhesion"]
    (line,) = (line for line in text.splitlines() if line.startswith("sticking"))
    assert f"flat enough to stick: full contact costs {1e3 * full:.3g} mJ/m² of γ = 5 mJ/m²" in line
    _, text, _ = rough_loop(tmp_path, "--preload", "0.5kPa")
    assert "stick" not in text


def test_a_mean_stress_that_the_loop_does_not_have_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ("--preload", "100", "--fields", "f.npz", "--field-stresses", "5kPa")
    assert main([*SCENE, *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--field-stresses: stress is 5000 Pa: on the unloading branch the mean stress in" in line
    assert not list(tmp_path.iterdir())


def test_the_way_of_a_trace_under_a_weight_has_a_unit(monkeypatch):
    monkeypatch.setattr(Loops, "running", {"answer": ("unloading", -3.4e4)})
    for control, text in ((Control(0.0), "p̄ -34 kPa)"), (Control(), "Δ/h_max -3.4e+04)")):
        cycle = Cycle(HALF_SPACE, (0.04,), (1.0,), control=control)
        run = Run("answer", single_wave(1e-6, 1e-3), cycle, 0.04, 1.0)
        assert f"(unloading, {text}" in f"{Loops([run], 1)}"


def test_fields_are_written_at_mean_stresses(tmp_path):
    path = tmp_path / "fields.npz"
    document, *_ = rough_loop(tmp_path, "--preload", "500", "--fields", str(path))
    found = np.load(path)
    wanted = np.tile(500.0 * np.array([0.25, 0.5, 0.75, 1.0]), 2)
    assert found["mean_stress"] == pytest.approx(wanted, rel=1e-8)
    assert found["branch"].tolist() == ["loading"] * 4 + ["unloading"] * 4
    assert found["gap"].mean(axis=1) == pytest.approx(found["separation"], rel=1e-3)
    assert found["penetration"][7] == pytest.approx(document["turning_point"], rel=1e-9)
    words = ("--fields", str(path), "--field-stresses=-100", "--stiffness", "1e9")
    rough_loop(tmp_path, *words, "--max-penetration", "0.6")
    found = np.load(path)  # no state of contact has so small a tension on loading
    assert found["mean_stress"] == pytest.approx([-100.0], rel=1e-8)
    assert found["branch"].tolist() == ["unloading"]


@pytest.mark.usefixtures("quick_figures")
def test_a_trace_turns_at_the_preload(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(answers, "Loops", lambda jobs, *_: Loops(jobs, 0))  # in this process
    rng = np.random.default_rng(1)
    x = np.linspace(0, 1e-3, 200)
    z = sum(1e-6 / n * np.cos(2 * np.pi * n * x / 1e-3 + rng.uniform(0, 6)) for n in range(1, 6))
    path = tmp_path / "trace.csv"
    np.savetxt(path, np.transpose([x, z]), delimiter=",")
    words = ["trace", str(path), "--unit", "m", "--work-of-adhesion", "0.002", "--young", "1e6"]
    words += ["--poisson", "0.5", "--quick", "--quiet", "--load-steps", "3"]
    assert main([*words, "--preload", "300", "--to", str(tmp_path / "out")]) == 0
    assert "to a preload of 300 Pa at a fixed separation" in capsys.readouterr().out
    document = json.loads((tmp_path / "out" / "trace.json").read_text())
    assert document["preload"] == 300.0
    assert document["max_penetration"] is None
    assert document["loop"]["turning_stress"] == pytest.approx(300.0, rel=1e-8)
    prepared = prepare_trace(read_trace(path, unit="m"))
    scene = {"half_space": HALF_SPACE, "work_of_adhesion": 0.002, "load_steps": 3}
    latest = {"max_penetration": 0.5, "quick": True, "processes": 0}
    far = adhesis.loss_of_trace(prepared, **scene, preload=1e9, **latest)
    (others,) = (text for text in far.warnings if "did not turn at the preload" in text)
    count = len(far.plan.runs) - 1
    assert others.startswith(f"{count} of {count} other loops did not turn at the preload: “")
    weight = adhesis.loss_of_trace(
        prepared, **scene, max_stress=300.0, control=Control(0), quick=True, processes=0
    )
    (line,) = (line for line in str(weight).splitlines() if line.startswith("loss"))
    assert "(under a weight; it falls off at " in line
    assert "(under a weight; it falls off at " in page_text(weight, {}).split("pull-off", 1)[0]


PRELOADS = [100.0, 400.0]


def text_of(
    cycle: str = 'preload = ["0.1 kPa", 400]\nmax_penetration = 0.95', **changes: str
) -> str:
    values = {"n0": "2", "work_of_adhesion": "[0.002]", "hurst": "[0.8]", "load_steps": "10"}
    values |= {"method": '"sharp"'} | changes
    text = campaign_text(**values).replace("nodes_per_wave = 16\n", "")
    return text.replace("max_penetration = 0.6", cycle)


@pytest.mark.usefixtures("quick_figures")
def test_a_campaign_of_preloads_from_end_to_end(tmp_path, capsys):
    file, out = tmp_path / "c.toml", tmp_path / "c.h5"
    file.write_text(text_of(realisations="2"))
    assert main(["run", str(file), "--out", str(out)]) == 0
    capsys.readouterr()
    assert main(["status", str(out), "--json"]) == 0
    status = json.loads(capsys.readouterr().out)
    assert (status["done"], status["failed"], status["pending"]) == (4, 0, 0)
    campaign = parse_campaign(file.read_text())
    with adhesis.open(out) as results:
        loops = results.dataset.load()
    assert loops.turning_stress.values == pytest.approx(
        np.broadcast_to(np.reshape(PRELOADS, (-1, 1)), (1, 1, 2, 2)), rel=1e-8
    )
    assert (loops.preload_reached == 1).all()
    for task in list(campaign.tasks())[::2]:
        row = Runner()(campaign, task)
        here = loops.sel(preload=dict(task.others)["preload"], realisation=task.realisation)
        assert float(here.loss.squeeze()) == row["loss"]
        method = make_method("sharp", make_problem(campaign, task))
        preload = dict(task.others)["preload"]
        loop = run_loop(method, preload=preload, max_penetration=0.95, load_steps=10)
        assert row["loss"] == pytest.approx(loop.loss, rel=1e-4)
        assert row["turning_penetration"] == pytest.approx(loop.max_penetration, rel=1e-7)
        beyond = campaign.penetration["loading"] > loop.max_penetration
        assert np.isnan(row["loading_mean_stress"][beyond]).all()
        assert row["loading_mean_stress"][~beyond].max() <= preload * (1 + 1e-9)
        gap = row["field_gap"].mean(axis=-1)[:, -1]
        assert gap == pytest.approx(row["h_max"] * (1 - loop.max_penetration), rel=1e-3)
        assert np.isfinite(row["psd_displacement"]).all()
    folder = tmp_path / "report"
    assert main(["report", str(out), "--to", str(folder)]) == 0
    page = (folder / "report.md").read_text()
    assert "preload of 0.1 … 0.4 kPa" in page
    assert "Every loop reached its preload." in page
    assert (folder / "loss_along_preload.png").exists()


SHORT = "loops short of the preload"


def hollow(axes: Axes) -> list[float]:
    lines = [line for line in axes.lines if line.get_markerfacecolor() == "white"]
    return [x for line in lines for x in line.get_xdata()]


def test_loops_short_of_their_preload_are_counted_below_the_figures(tmp_path):
    """They turned at one depth, whatever the preload, which the figure would seem to deny."""
    text = re.sub(r"preload = .*", "preload = [1e8, 2e8]", text_of(realisations="1"))
    results = adhesis.Campaign(text).run(tmp_path / "c.h5")
    figure = results.plot.loss_along("preload")
    below = figure.get_supxlabel().splitlines()
    assert below == ["2 of 2 loops did not reach the preload", "n = 1 profile"]
    assert [text.get_text() for text in figure.legends[0].get_texts()][-1] == SHORT
    assert [len(hollow(axes)) for axes in figure.axes] == [2] * 5
    said = " ".join(findings.agreement(results.averages))
    assert "Along preload from 100 MPa to 200 MPa no trend is given: in every series" in said


def test_series_with_loops_short_of_their_preload_show_no_trend(tmp_path):
    """They are one loop, whatever the preload: its loss does not "stay the same"."""
    text = campaign(hurst=(0.8,), gamma=(0.01, 0.04), realisations=2).text
    plan = parse_campaign(text.replace("max_penetration = 0.9", "preload = [100, 200]"))
    values = rows(plan)
    last = [t.work_of_adhesion == 0.04 and t.others[0][1] == 200 for t in plan.tasks()]
    values["preload_reached"] = 1.0 - np.array(last)
    data = aggregate(write(tmp_path / "r.h5", plan, values))
    (said,) = (s for s in findings.agreement(data) if s.startswith("Along preload"))
    assert " in 1 of 1 series of cells that are else alike; not counted, as loops did not" in said
    assert said.endswith("did not reach their preload: H = 0.8, γ = 0.04 J/m².")
    page = write_page(data, sections(data))
    assert page.count("states are at parts of it instead of penetrations.") == 4


def test_a_machine_of_a_campaign_may_go_beyond_the_height_of_its_profile():
    """u_tot/h_max = Δ/h_max + p̄/(k h_max) at the preload."""
    campaign = parse_campaign(
        text_of("preload = 400\nstiffness = 1e8\nmax_penetration = 6", realisations="1")
    )
    (task,) = campaign.tasks()
    row = Runner()(campaign, task)
    assert row["preload_reached"] == 1
    stress = row["loading_mean_stress"]
    beyond = row["turning_penetration"] + 400 / (1e8 * row["h_max"])
    assert beyond > 1
    known = campaign.penetration["loading"] <= beyond
    assert np.isfinite(stress[known]).all()
    assert np.isnan(stress[~known]).all()
    assert np.isfinite(row["field_gap"]).all()


@pytest.mark.usefixtures("quick_figures")
def test_a_campaign_says_which_loops_did_not_reach_their_preload(tmp_path, capsys):
    file, out = tmp_path / "c.toml", tmp_path / "c.h5"
    file.write_text(text_of('preload = [100, "1 MPa"]', realisations="1"))
    assert main(["run", str(file), "--out", str(out)]) == 0
    assert f"1 loop did not reach the preload (adhesis status {out})" in capsys.readouterr().err
    with pytest.warns(UserWarning, match="^1 loop did not reach the preload$"):
        adhesis.Campaign(file).run(out, progress=False)
    (sentence,) = (s for s in findings.quality(aggregate(out)) if "did not reach" in s)
    assert "WARNING: 1 of 2 loops did not reach the preload, and turned at the latest" in sentence
    with adhesis.open(out) as results:
        highest = 1e-3 * results.dataset.loading_mean_stress.max().item()
    reached = f"(at load steps the mean stress is at most {highest:.3g} kPa)"
    assert f"1 at H = 0.8, γ = 0.002 J/m², preload = 1 MPa {reached}" in sentence
    capsys.readouterr()
    assert main(["status", str(out)]) == 0
    assert "1 loop did not reach the preload" in capsys.readouterr().out
    page = tmp_path / "report"
    assert main(["report", str(out), "--to", str(page)]) == 0
    table = (page / "losses.csv").read_text().splitlines()
    place = table[0].split(",").index("short_of_preload")
    assert [row.split(",")[place] for row in table[1:]] == ["0", "1"]
    text = (page / "report.md").read_text()
    assert " | short | " in text
    turn = "0.0001 … 1 MPa (1 of 2 loops turned before that)"
    assert text.split("\n\n")[1].startswith(f"A loop to a preload of {turn} and back until")
    steps = "in steps of which 10 would lead to Δ/h_max = 0.999 and unloaded"
    assert f" Each loop was loaded to a preload of {turn} {steps} until detached; " in text
    assert "short: loops that turned before their preload was reached" in text
    assert text.count("turn at different penetrations") == 2
    with adhesis.open(out) as results:
        figure = results.plot.loss_along("preload")
        (mark,) = hollow(figure.axes[0])
        assert mark == pytest.approx(1.0)  # MPa, the second of the two
        loops = results.dataset
        assert loops.preload_reached.values.ravel().tolist() == [1.0, 0.0]
        assert loops.turning_penetration.values.ravel()[1] == 0.999


def test_a_campaign_under_a_weight_says_so_and_its_shares_are_of_the_drops_before(tmp_path, capsys):
    """Of profiles that are nearly in full contact when the weight tears them off."""
    file, out = tmp_path / "c.toml", tmp_path / "c.h5"
    changes = {"realisations": "2", "ratio": "6", "work_of_adhesion": "[0.014]"}
    file.write_text(text_of('control = "load"\nmax_stress = 200', **changes))
    assert main(["run", str(file), "--out", str(out)]) == 0
    with h5py.File(out) as results:
        drops, after = results["jump_energy_drop"][:], results["jump_patches_after"][:]
        last = drops[after == 0]
        assert (last < 0).all()
        before = np.where(after > 0, drops, 0).sum(axis=1)
        scales = results["loss_small_scale"][:] + results["loss_large_scale"][:]
        np.testing.assert_allclose(scales, before, rtol=1e-12)
        np.testing.assert_allclose(results["loss_from_drops"][:], before + last, rtol=1e-9)
    capsys.readouterr()
    assert main(["status", str(out)]) == 0
    assert "under a weight: closed at the separation of its fall" in capsys.readouterr().out
    data = aggregate(out)
    outcome = findings.verdict(data)[0]
    assert "under a weight, which falls off at " in outcome
    assert "(the loop is closed at the separation of the fall)" in outcome
    table = campaign_tables.jumps(data)
    share = table.columns.index(next(c for c in table.columns if c.name == "share_of_drops"))
    shares = [row[share] for row in table.rows]
    assert min(shares) >= 0
    assert sum(shares) == pytest.approx(1)
    assert data.cells[0].jumps.histogram.sum() == (after > 0).sum()
