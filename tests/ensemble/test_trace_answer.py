"""From a file to an answer: its loss, its interval, its page; what fails is said."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
import signal
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from markdown_it import MarkdownIt
from matplotlib.image import imread

from adhesis import Control, self_affine_profile, stripes
from adhesis.ensemble.command.main import main
from adhesis.ensemble.command.options import what_was_read
from adhesis.ensemble.report.html import html_page
from adhesis.ensemble.trace import answer as answers
from adhesis.ensemble.trace.answer import (
    QUANTITIES,
    Answer,
    NoAnswer,
    Uncertain,
    make_cycle,
    run_plan,
)
from adhesis.ensemble.trace.answer import document as document_of
from adhesis.ensemble.trace.loops import Loops
from adhesis.ensemble.trace.prepare import Prepared, prepare_trace
from adhesis.ensemble.trace.reading.measured_trace import Trace, read_trace
from adhesis.ensemble.trace.trace_page import _tables as tables_of
from adhesis.ensemble.trace.trace_page import page_text, summary
from adhesis.ensemble.trace.variants import TABLES, Plan, make_plan
from benchmarks.trace_coverage import case, judged
from tests.support.campaign_support import ranks_of
from tests.support.figures import few_figures
from tests.support.scenes import HALF_SPACE
from tools.interrupted import Interrupt

N, LENGTH = 400, 1e-3
PROFILE = self_affine_profile(0.8, period=LENGTH, n0=4, ratio=6, seed=2, h_rms=1e-6)
X = LENGTH / N * np.arange(N)
CONTACT = ["--work-of-adhesion", "0.04", "--young", "1e6", "--poisson", "0.5"]
FIGURES = ["cut-off.png", "loop.png", "spectrum.png", "tables.png", "trace.png"]
SAVED = "loop.png"  # the one that is laid out and written: all are by one function


def only(plan: Plan, *names: str) -> Plan:
    """Return the plan with these runs alone."""
    return dataclasses.replace(plan, runs=tuple(run for run in plan.runs if run.name in names))


@cache
def prepared() -> Prepared:
    heights = PROFILE.at(X) + 1e-3 * X + 5e-9 * np.random.default_rng(0).standard_normal(N)
    return prepare_trace(Trace(heights, LENGTH / N, "t.txt"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command makes of a file with gaps, decimal commas and a bow."""
    folder = tmp_path_factory.mktemp("trace")
    z = PROFILE.at(X + 0.3e-3) + 2e-3 * X + 8e-6 * (2 * X / LENGTH - 1) ** 2
    z = z + 5e-9 * np.random.default_rng(0).standard_normal(N)
    rows = [f"{1e3 * a:.5f};{1e6 * b:.4f}" for a, b in zip(X, z, strict=True)]
    rows[100] = rows[100].split(";")[0] + ";"
    text = "Weg (mm);Höhe (µm)\n" + "\n".join(rows).replace(".", ",")
    (folder / "t.csv").write_text(text, encoding="latin-1")
    words = ["trace", str(folder / "t.csv"), *CONTACT, "--to", str(folder / "out"), "--quiet"]
    # each process costs more than these loops
    words = [*words, "--processes", "1", "--load-steps", "10"]
    with few_figures("loop"):
        assert main(words) == 0
    return folder / "out"


@pytest.fixture(scope="module")
def document(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "trace.json").read_text())
    return found


def test_the_interval_is_made_of_the_doubts(document: dict[str, Any]) -> None:
    doubts = document["loss"]["doubts"]
    assert {"cut-off", "continuation", "form", "noise", "numerics"} == set(doubts)
    spread = np.sqrt(sum(d**2 for d in doubts.values()))
    relative = document["loss"]["uncertainty"] / document["loss"]["value"]
    assert relative == pytest.approx(2 * spread)  # as the page says; measured: trace_coverage.py
    changes = [r["loss_change"] for r in document["runs"] if r["group"] == "continuation"]
    assert len(changes) == 3
    assert doubts["continuation"] == pytest.approx(np.sqrt(np.mean(np.square(changes))))
    losses = {r["name"]: r["loss"] for r in document["runs"]}
    change = losses["taper 5 %"] / losses["answer"] - 1
    assert change in [pytest.approx(c) for c in changes]


def test_the_document_says_what_was_read_done_and_found(document: dict[str, Any]) -> None:
    assert document["read"]["points"] == N
    assert document["read"]["drop_outs"] == 1
    assert document["read"]["step"] == pytest.approx(LENGTH / N, rel=1e-4)
    assert [step["name"] for step in document["preparation"]] == ["drop-outs", "form", "cut-off"]
    assert document["degree"] == 2
    noisy = [r["name"] for r in document["runs"] if r["group"] == "noise"]
    assert noisy == ["noise 1", "noise 2"]
    tables = {r["name"]: r for r in document["runs"] if r["group"] in TABLES}
    assert set(tables) == {"γ 0.02", "γ 0.08", "Δ 0.3", "Δ 0.6"}
    assert tables["γ 0.02"]["loss"] < document["loss"]["value"] < tables["γ 0.08"]["loss"]
    assert tables["Δ 0.3"]["contact_fraction"] < document["contact_fraction"]["value"]
    assert document["loop"]["states"]["penetration"][0] == 0
    assert document["loop"]["loss"] == document["loss"]["value"]


def test_the_range_is_the_least_of_the_answer_and_its_variants(document: dict[str, Any]) -> None:
    alike = [run for run in document["runs"] if run["group"] not in TABLES]
    ranges = [run["valid_range"] for run in alike if run["valid_range"] is not None]
    assert document["valid_range"] == min(ranges) > 1e-9
    assert document["largest_interior_tension"] == max(
        run["largest_interior_tension"] for run in alike
    )


def test_the_page_holds_its_figures_and_needs_nothing_else(folder: Path) -> None:
    pdfs = [name.replace(".png", ".pdf") for name in FIGURES]
    made = [*FIGURES, *pdfs, "trace.html", "trace.json", "trace.md"]
    assert imread(folder / SAVED).shape[0] > 300
    assert sorted(p.name for p in folder.iterdir()) == sorted(made)
    html = (folder / "trace.html").read_text()
    assert html.count('src="data:image/png;base64,') == len(FIGURES)
    assert re.findall(r'(?:src|href)="(?!data:)', html) == []
    text = (folder / "trace.md").read_text()
    for name in FIGURES:
        assert f"]({name})" in text
    table = re.findall(r"^\| +([\d.]+) +\| +([\d.]+) +\| +[\d.]+ ± ", text, re.M)
    gammas, depths = ("0.02", "0.04", "0.04", "0.04", "0.08"), ("0.9", "0.3", "0.6", "0.9", "0.9")
    assert table == list(zip(gammas, depths, strict=True))
    for words in ("decimal commas", "tilt and bow", "interval", "taper 10 %", "γ, J/m²"):
        assert words in text, words
        assert words in html, words


def test_the_document_carries_its_provenance(folder: Path, document: dict[str, Any]) -> None:
    found, source = document["provenance"], (folder.parent / "t.csv").read_bytes()
    assert found["input"]["sha256"] == hashlib.sha256(source).hexdigest()
    assert found["command"].startswith(f"adhesis trace {folder.parent}/t.csv --work-of-adhesion")
    assert found["seed"] is None
    units = found["units"]
    assert units["loss.value"] == units["loss.uncertainty"] == units["runs.loss"] == "J/m²"
    assert units["loss.doubts.noise"] == units["contact_fraction.value"] == "1"
    assert units["pull_off_stress.value"] == units["loop.states.mean_stress"] == "Pa"
    assert units["read.step"] == units["cut_off_limits.noise"] == "m"
    assert (units["spectrum.wave_number"], units["spectrum.power"]) == ("rad/m", "m³")
    assert document["loss_over_work_of_adhesion"] == document["loss"]["value"] / 0.04


@pytest.mark.parametrize(
    ("words", "control", "turns", "pattern"),
    [
        (["--stiffness", "0", "--max-stress", "300.0,100.0"], Control(0.0), (300.0, 100.0), None),
        (["--stiffness", "1e9", "--max-penetration", "0.6,0.3"], Control(1e9), (0.6, 0.3), None),
        (["--max-penetration", "0.6"], Control(), (0.6, 0.2, 0.4), None),
        (["--stripes", "8", "--stripe-amplitude", "0.3"], Control(), None, stripes(8, 0.3)),
    ],
)
def test_the_command_passes_what_is_given(words, control, turns, pattern, tmp_path, monkeypatch):
    path = tmp_path / "t.txt"
    np.savetxt(path, 1e6 * np.column_stack([X, PROFILE.at(X)]))
    given: list[Any] = []

    def stop(prepared: Prepared, cycle: Any, plan: Plan, progress: bool) -> Answer:
        given.append(cycle)
        raise NoAnswer("stopped")

    monkeypatch.setattr("adhesis.ensemble.command.trace.run_plan", stop)
    rest = ["--unit", "um", "--to", str(tmp_path / "out"), "--quiet"]
    assert main(["trace", str(path), *CONTACT, *rest, *words]) == 1
    assert (given[0].control, given[0].pattern) == (control, pattern)
    assert turns is None or given[0].turning_points == turns


@pytest.mark.parametrize(
    ("control", "at_preload", "turn", "said", "label"),
    [
        (Control(), False, 0.3, "Δ/h_max = 0.3", r"$\Delta/h_{\max}$"),
        (
            *(Control(1e9), False, 0.3, "u_tot/h_max = 0.3 of a stiffness of 1e+09 Pa/m"),
            r"$u_\mathrm{tot}/h_{\max}$",
        ),
        (Control(0.0), False, 2e4, "p̄ = 20 kPa", r"$\bar p$ (kPa)"),
        (Control(), True, 2e4, "a preload of 20 kPa at a fixed separation", "preload (kPa)"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_text_and_figure_say_what_turning_points_are(control, at_preload, turn, said, label):
    cycle = make_cycle(HALF_SPACE, 0.04, turn, 4, "auto", 1e-3, control, at_preload=at_preload)
    assert cycle.turn(turn) == said
    numbers = dict.fromkeys(QUANTITIES, 0.5) | {"pull_off_stress": 0.0}  # as without adhesion
    found: Any = SimpleNamespace(
        cycle=cycle,
        works_of_adhesion=[(0.04, numbers)],
        turning_points=[(point, numbers) for point in sorted(cycle.turning_points)],
        **dict.fromkeys(QUANTITIES, Uncertain(0.5, 0.1, {})),
    )
    drawn = tables_of(found)
    assert drawn[0].axes[-1].get_xlabel() == f"turning point: {label}"


def test_every_loop_of_a_trace_is_held_as_its_cycle_says() -> None:
    cycle = make_cycle(HALF_SPACE, [0.04, 0.02], [0.3, 0.5], 4, "auto", 1e-3, Control(1e9))
    plan = make_plan(prepared(), cycle, processes=0)
    assert {run.group for run in plan.runs} > {"answer", "noise", *TABLES}
    assert {run.cycle.control.stiffness for run in plan.runs} == {1e9}


@cache
def small_plan() -> tuple[Prepared, Any, Plan]:
    trace = prepared()
    cycle = make_cycle(HALF_SPACE, 0.04, 0.3, 4, "auto", 1e-3)
    plan = make_plan(trace, cycle, quick=True, processes=0)
    return trace, cycle, only(plan, "answer", "blend 10 %", "noise 1")


def spoiled(plan: Plan, name: str) -> Plan:
    """The same plan, with a loop that cannot be run."""
    runs = tuple(
        dataclasses.replace(run, turning_point=2.0) if run.name == name else run
        for run in plan.runs
    )
    return dataclasses.replace(plan, runs=runs)


def test_without_adhesion_nothing_is_lost_and_no_range_is_doubted() -> None:
    trace, cycle = prepared(), make_cycle(HALF_SPACE, 0.0, 0.3, 4, "auto", 1e-3)
    plan = make_plan(trace, cycle, quick=True, processes=0)
    answer = run_plan(trace, cycle, only(plan, "answer", "blend 10 %", "noise 1"))
    assert (answer.loss.value, answer.loss.uncertainty, answer.loss.doubts) == (0, 0, {})
    assert not [text for text in answer.warnings if "known to" in text or "converged" in text]
    assert "without adhesion there is none" in summary(answer)
    assert not re.search("^(doubts|changes)", summary(answer), re.MULTILINE)


@pytest.fixture(scope="module")
def spoiled_answer() -> Answer:
    trace, cycle, plan = small_plan()
    return run_plan(trace, cycle, spoiled(plan, "blend 10 %"))


def test_a_variant_that_fails_is_a_warning_and_the_answer_stands(spoiled_answer: Answer) -> None:
    trace, cycle, plan = small_plan()
    found = spoiled_answer
    assert any("“blend 10 %” did not end (ValueError" in warning for warning in found.warnings)
    assert "continuation" not in found.loss.doubts
    assert found.loss.value > 0
    with pytest.raises(NoAnswer, match="could not be run to its end: ValueError"):
        run_plan(trace, cycle, spoiled(plan, "answer"))


def test_the_page_shows_names_headers_and_warnings_as_texts(spoiled_answer, tmp_path):
    """Neither page has an element that a name or a header of a file brought along."""
    before = spoiled_answer.prepared
    said = ("text", "channel ![z](/etc/hostname) <script>x</script> \x1b[31m")
    evil = dataclasses.replace(before.trace, source="![x](y.png)`<script>`|.txt", notes=said)
    answer = dataclasses.replace(
        spoiled_answer,
        prepared=dataclasses.replace(before, trace=evil),
        warnings=("a <script> of ![w](/etc/passwd)",),
    )
    page = page_text(answer, {})
    by_markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    for text in (html_page(page, tmp_path), by_markdown.render(page)):
        assert "<script" not in text
        assert "<img" not in text
        assert "\x1b" not in text
        for shown in ("![x](y.png)`&lt;script&gt;`|.txt", "channel ![z](/etc/hostname) &lt;script"):
            assert shown in text
    assert "\x1b" not in what_was_read(answer.prepared)


def with_losses(answer: Answer, losses: dict[str, float], limits: dict[str, float]) -> Answer:
    """The answer of a plan whose loops end with these losses in J/m²."""
    trace = dataclasses.replace(answer.prepared, cut_off=10e-6, limits=limits)
    runs = []
    for name in losses:
        group = "answer" if name == "answer" else "cut-off" if "cut-off" in name else "noise"
        factor = name.partition("× ")[2] if group == "cut-off" else ""
        changes = {"cut_off": float(factor) * 10e-6} if factor else {}
        own: Any = {"name": name, "group": group, "description": "", "changes": changes}
        runs.append(dataclasses.replace(answer.plan.runs[0], **own))
    results = {
        name: answer.main | {"loss": loss, "warnings": [], "races": 0}
        for name, loss in losses.items()
    }
    plan = dataclasses.replace(answer.plan, runs=tuple(runs))
    return dataclasses.replace(answer, prepared=trace, plan=plan, results=results)


def test_the_finest_cut_offs_decide_whether_short_waves_matter(spoiled_answer: Answer) -> None:
    """A change between longer waves is no doubt of the answer's loss where finer ones agree."""
    limits = {"step": 5e-6, "noise": 10e-6}
    fine = {"answer": 1.0, "cut-off × 2": 0.8, "cut-off × 1.41": 0.99, "cut-off × 0.707": 1.01}
    found = with_losses(spoiled_answer, fine, limits)
    quantity = answers._quantity(found, "loss")
    assert answers._warnings(found, quantity) == []
    assert quantity.doubts["cut-off"] == pytest.approx(0.01)
    coarse = {"answer": 1.0, "cut-off × 1.41": 0.99, "cut-off × 0.707": 1.2}
    found = with_losses(spoiled_answer, coarse, limits)
    (text,) = answers._warnings(found, answers._quantity(found, "loss"))
    assert text == (
        "the short-wave end is not converged: a shortest wave of 7.07 µm instead of 10 µm changes "
        "the loss by +20 %; the noise of the instrument hides shorter waves: average several scans"
    )
    for limit, words in (("step", "a finer step would"), ("tip", "a sharper tip would")):
        found = with_losses(spoiled_answer, coarse, {limit: 10e-6})
        assert words in answers._warnings(found, answers._quantity(found, "loss"))[0]
    found = with_losses(spoiled_answer, coarse, {"step": 1e-6})
    assert "the cut-off that was given" in answers._warnings(found, found.loss)[0]


def test_a_short_range_of_a_variant_is_warned_of_as_the_line_shows_it(spoiled_answer) -> None:
    losses = {"answer": 1.0, "noise 1": 1.0, "noise 2": 1.0}
    found = with_losses(spoiled_answer, losses, {"step": 1e-6})
    found.results["noise 1"]["valid_range"] = 4e-10
    (text,) = answers._warnings(found, answers._quantity(found, "loss"))
    assert text.startswith("valid_range is 0.4 nm: the zero-range limit holds only")
    assert "reaches less than 0.4 nm" in summary(found)
    found.main["valid_range"] = 6e-10
    found.main["warnings"] = [text.replace("0.4", "0.6", 1)]
    assert answers._warnings(found, answers._quantity(found, "loss")) == [text]


def test_a_loss_that_is_hardly_known_names_its_largest_doubt(spoiled_answer: Answer) -> None:
    losses = {"answer": 9.705, "cut-off × 1.41": 9.7, "noise 1": 19.4, "noise 2": 19.4}
    found = with_losses(spoiled_answer, losses, {"step": 1e-6})
    quantity = answers._quantity(found, "loss")
    (text,) = answers._warnings(found, quantity)
    assert text == (
        "the loss is known to 200 % only, mostly for the doubt “noise” (noise of the instrument; "
        "standard uncertainty 100 %): average several scans"
    )
    assert "loss        10000, from 0 to 29000 mJ/m²" in summary(
        dataclasses.replace(found, loss=quantity)
    )
    of_zones = dataclasses.replace(quantity, doubts={"noise": 0.2, "zones": 0.9})
    (text,) = answers._warnings(found, of_zones)
    assert "doubt “zones” (cohesive zones at edges, left out; standard uncertainty 90 %)" in text


def test_what_changes_the_loss_most_stands_first_with_its_factor(spoiled_answer: Answer) -> None:
    losses = {"answer": 1.0, "cut-off × 4": 3.73, "cut-off × 1.41": 1.1, "noise 1": 0.98}
    found = with_losses(spoiled_answer, losses, {"step": 1e-6})
    found = dataclasses.replace(found, loss=answers._quantity(found, "loss"), warnings=("doubt",))
    text = (
        "most by “cut-off × 4” (): × 3.73, beyond the interval; of the other decisions by "
        "“noise 1” (): × 0.98"
    )
    lines = summary(found).splitlines()
    assert lines[3] == f"changes     {text}"
    page = page_text(found, {})
    assert page.index(f"- **changes**: {text}") < page.index("**Warning:** doubt")
    assert answers.document(found)["largest_changes"][0] == {"name": "cut-off × 4", "factor": 3.73}
    nothing = with_losses(spoiled_answer, losses | {"noise 1": 0.0}, {"step": 1e-6})
    ((run, factor),) = nothing.largest_changes
    assert (run.name, factor) == ("noise 1", 0.0)


@pytest.mark.usefixtures("quick_figures")
def test_figures_of_an_earlier_page_do_not_stay_beside_a_new_one(spoiled_answer, tmp_path):
    """An answer with neither tables nor several cut-offs; a figure of the user's own stays."""
    for name in ("tables.png", "tables.pdf", "cut-off.png", "loop.png", "mine.png"):
        (tmp_path / name).write_bytes(b"old")
    spoiled_answer.page(tmp_path)
    figures = sorted(path.name for path in tmp_path.glob("*.png"))
    assert figures == ["loop.png", "mine.png", "spectrum.png", "trace.png"]
    assert not (tmp_path / "tables.pdf").exists()
    assert (tmp_path / "loop.png").read_bytes() != b"old"  # figures are not drawn here


def test_loops_that_failed_are_named_last_in_one_warning(spoiled_answer: Answer) -> None:
    losses = {"answer": 1.0, "cut-off × 1.41": 1.5, "noise 1": 1.0, "noise 2": 1.0}
    found = with_losses(spoiled_answer, losses, {"step": 1e-6})
    results = found.results | {"noise 1": "Reason: a", "noise 2": "Reason: b"}
    found = dataclasses.replace(found, results=results)
    *others, last = answers._warnings(found, answers._quantity(found, "loss"))
    assert len(others) == 2
    assert "“noise 1” did not end (Reason: a)" in last
    assert "“noise 2” did not end (Reason: b)" in last


@pytest.mark.usefixtures("quick_figures")
def test_a_crest_that_carries_all_contact_is_warned_of_and_left_out_once(tmp_path: Path) -> None:
    """A ridge of 9 µm on a roughness of 1 µm, pressed to half its height."""
    x = 1e-6 * np.arange(1000)
    z = PROFILE.at(x) + 9e-6 * np.exp(-(((x - 0.64e-3) / 12e-6) ** 2))
    trace = prepare_trace(Trace(z, 1e-6, "t.txt"))
    cycle = make_cycle(HALF_SPACE, 0.001, 0.5, 4, "auto", 1e-2)
    plan = make_plan(trace, cycle, quick=True, processes=0)
    plan = only(plan, "answer", "without single features")
    answer = run_plan(trace, cycle, plan)
    assert answer.warnings[0].startswith("a single crest at 640 µm stands")
    assert answer.warnings[1].startswith("one crest at 640 µm carries all contact")
    ((run, factor),) = answer.largest_changes
    assert run.description == "crest at 640 µm bridged by straight lines"
    assert factor > 5
    # The loop without it is that of the trace from which it is excluded.
    (feature,) = trace.features
    clean = prepare_trace(Trace(z, 1e-6, "t.txt"), exclude=[(feature.begin, feature.end)])
    np.testing.assert_allclose(
        clean.profile(cut_off=trace.cut_off).coefficients,
        trace.profile(without_features=True).coefficients,
        atol=1e-15,
    )
    path = answer.page(tmp_path)
    text = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "Shaded in orange: crest at 640 µm." in text
    document = json.loads(path.with_suffix(".json").read_text())
    assert document["single_features"][0]["position"] == pytest.approx(640e-6, abs=2e-6)


def test_the_command_plans_with_ranges_left_out_and_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("adhesis.ensemble.command.options._LARGE", 0)
    monkeypatch.setattr("adhesis.ensemble.reporter.interval", lambda elapsed: 1e-3)
    path = tmp_path / "t.txt"
    rows = [f"{1e6 * a:.3f};{1e6 * z:.6f}" for a, z in zip(X, PROFILE.at(X), strict=True)]
    path.write_text("\n".join(["x (µm);z (µm)", *rows]).replace(".", ","))
    words = ["trace", str(path), *CONTACT, "--tip-radius", "2um", "--plan"]
    assert main([*words, "--exclude", "0.2mm:230um", "--exclude", "900um:2mm"]) == 0
    said, progress = capsys.readouterr()
    assert progress.startswith(f"reading {path}")
    for text in ("400 points, step 2.5 µm", "decimal commas", "positions in µm", "plan ", "waves"):
        assert text in said
    assert sorted(tmp_path.iterdir()) == [path]
    assert "excluded    200 µm to 230 µm, as given: 13 heights treated as drop-outs" in said
    assert "excluded    900 µm to 2 mm, as given: 40 heights" in said
    assert "ends        cut off where heights are missing: 40" in said


def test_the_summary_states_the_scope(document: dict[str, Any], folder: Path) -> None:
    page = (folder / "trace.md").read_text(encoding="utf-8")
    (scope,) = re.findall(r"^- \*\*scope\*\*: (.*)$", page, re.M)
    largest = max(document["loop"]["states"]["mean_stress"])
    assert scope.startswith("one period of parallel grooves, 950 µm wide; the mean stress ")
    assert (f"a compression of {1e-3 * largest:.3g} kPa" in scope) == (largest > 0)
    assert "at least 2 %" in page


def test_unphysical_input_is_doubted_and_zero_range_comes_first() -> None:
    trace, cycle, _ = small_plan()
    found = of_the_answer_alone(dataclasses.replace(cycle, works_of_adhesion=(30.0,)), trace)
    assert found.pull_off_stress.value > 0.3 * 1e6
    assert any("of Young's modulus: small strain does not hold" in text for text in found.warnings)


def test_a_process_that_is_killed_is_said_and_replaced() -> None:
    _, _, plan = small_plan()
    loops = Loops(plan.runs, processes=1)
    others = ranks_of(os.getpid())  # a helper of other tests, say
    killed: list[str] = []

    def watch(loops: Loops) -> None:
        if not killed and loops.running:
            killed.extend(loops.running)
            (process,) = set(ranks_of(os.getpid())) - set(others)
            os.kill(process, signal.SIGKILL)

    done = loops.run(watch, every=0.05)
    assert set(done) == {run.name for run in plan.runs}
    failed = [name for name, found in done.items() if isinstance(found, str)]
    assert failed == killed
    assert "ended with code -9" in str(done[killed[0]])


@pytest.mark.usefixtures("alarm")
@pytest.mark.parametrize("processes", [0, 2])
def test_an_interrupt_ends_all_loops_of_a_trace(processes: int) -> None:
    """In what was raised, though it is of a class that loops fail with; and no process is left."""
    _, _, plan = small_plan()
    loops = Loops(plan.runs, processes=processes)
    others = ranks_of(os.getpid())

    def watch(loops: Loops) -> None:
        if processes == 0 or len(loops.running) == processes:
            os.kill(os.getpid(), signal.SIGALRM)

    with pytest.raises(Interrupt):
        loops.run(watch, every=0.05)
    assert ranks_of(os.getpid()) == others


def test_long_traces_measure_their_doubts_with_fewer_waves() -> None:
    """And are priced before any work, with a word on what would be cheaper."""
    n = 100_000
    rng = np.random.default_rng(1)
    waves = rng.standard_normal(n // 2 + 1) * np.arange(n // 2 + 1).clip(30) ** -1.3
    heights = np.fft.irfft(waves * np.exp(1j * rng.uniform(0, 7, n // 2 + 1)), n)
    trace = Trace(1e-6 * heights / heights.std(), 0.2e-6, "t.txt")
    found = prepare_trace(trace)
    plan = make_plan(found, make_cycle(HALF_SPACE, 0.001, 0.9, 40, "auto", 1e-3), processes=2)
    assert plan.text.splitlines()[0].endswith(" on 2 cores of a quiet machine")
    assert plan.waves == pytest.approx(0.95 * n / 5, rel=0.01)
    sizes = {run.name: run.profile.highest_harmonic for run in plan.runs}
    assert sizes["taper 5 %"] < 8000 < sizes["answer"]
    reference = {run.name: run.reference for run in plan.runs}
    assert reference["taper 5 %"] == "cut-off × 4"
    assert sizes["blend 10 %"] == pytest.approx(sizes["cut-off × 4"], rel=0.06)
    assert any(hint.startswith("cut_off") for hint in plan.hints)
    assert any("quick" in hint for hint in plan.hints)


@pytest.mark.usefixtures("quick_figures")
def test_known_losses_lie_within_their_intervals(tmp_path: Path) -> None:
    """A case of the benchmark with fewer waves; all of it: benchmarks/trace_coverage.py."""
    row = judged(case(1, waves=20), tmp_path)
    for stated in (row[name] for name in QUANTITIES):
        assert stated["covered"], row
        assert stated["uncertainty"] < 0.6 * stated["stated"], row


def test_loop_takes_a_trace_with_its_warnings(tmp_path, capsys):
    heights = PROFILE.at(X) + 1e-3 * X + 9e-6 * np.exp(-(((X - 0.6e-3) / 8e-6) ** 2))
    path = tmp_path / "t.txt"
    np.savetxt(path, 1e6 * np.column_stack([X, heights]))
    words = ["loop", "--trace", str(path), *CONTACT, "--unit", "um", "--cut-off", "100um"]
    cheap = ["--load-steps", "5", "--max-penetration", "0.3", "--json", str(tmp_path / "l.json")]
    assert main([*words, *cheap, "--quiet", "--strict"]) == 1
    assert "400 points" in capsys.readouterr().out
    loop = json.loads((tmp_path / "l.json").read_text())
    assert loop["period"] == pytest.approx(0.95 * LENGTH)
    assert loop["warnings"][0].startswith("a single crest at 597.5 µm")


@pytest.mark.parametrize("gamma", [0.04, 0.001])
def test_a_plan_expects_no_more_patches_than_crests_that_are_reached(gamma: float) -> None:
    """Under a high ridge few are; the energy of full contact alone lets fifty be expected."""
    x = 1e-6 * np.arange(1000)
    ridge = 9e-6 * np.exp(-(((x - 0.64e-3) / 12e-6) ** 2))
    trace = prepare_trace(Trace(PROFILE.at(x) + ridge, 1e-6, "t.txt"))
    cycle = make_cycle(HALF_SPACE, gamma, 0.9, 40, "auto", 1e-3)
    plan = make_plan(trace, cycle, processes=0)
    found = of_the_answer_alone(cycle, trace).main
    assert found["patches"] / 3 <= plan.patches <= 3 * found["patches"]
    assert plan.seconds["Δ 0.3"] < plan.seconds["answer"]


def of_the_answer_alone(cycle: Any, trace: Prepared) -> Answer:
    """Run the answer's own loop of a trace."""
    return run_plan(trace, cycle, only(make_plan(trace, cycle, quick=True, processes=0), "answer"))


def test_turning_points_of_a_table_have_their_unit() -> None:
    for control, turn, unit in ((Control(), 0.3, ""), (Control(0.0), 100.0, "Pa")):
        cycle = make_cycle(HALF_SPACE, 1e-4, turn, 4, "auto", 1e-2, control)
        table = of_the_answer_alone(cycle, prepared()).to_dataframe()
        assert (table.turning_point[0], table.attrs["units"]["turning_point"]) == (turn, unit)


def test_stripes_reach_every_loop_of_a_trace_with_their_width() -> None:
    cycle = make_cycle(HALF_SPACE, 0.04, 0.3, 4, "auto", 1e-2, pattern=stripes(20, 0.3))
    trace = prepared()
    runs = {run.name: run for run in make_plan(trace, cycle, quick=True, processes=0).runs}
    periods = {name: run.profile.period for name, run in runs.items()}
    assert periods["blend 10 %"] < 0.96 * periods["answer"]
    width = periods["answer"] / 20
    for name, run in runs.items():
        problem = run.cycle.problem(run.profile, run.work_of_adhesion)
        assert problem.pattern.stripes[0] == round(periods[name] / width)
    found = document_of(of_the_answer_alone(cycle, trace))
    assert found["stripes"] == found["loop"]["stripes"] == 20
    assert found["stripe_amplitude"] == pytest.approx(0.3)
    assert found["least_work_of_adhesion"] == pytest.approx(0.7 * 0.04)


def test_a_range_of_a_trace_is_said_with_what_zones_at_edges_change() -> None:
    cycle = make_cycle(HALF_SPACE, 0.04, 0.3, 4, "auto", 1e-2, adhesion_range=2e-7)
    answer = of_the_answer_alone(cycle, prepared())
    found = document_of(answer)
    assert found["adhesion_range"] == pytest.approx(2e-7)
    assert found["zone_error"] > 0
    share = found["zone_error"] / found["loss"]["value"]
    assert answer.loss.doubts["zones"] == pytest.approx(share)
    assert "\nrange       adhesion of a range of 200 nm: " in str(answer)


@pytest.mark.usefixtures("quick_figures")
def test_adhesion_acts_on_the_projection_if_it_is_asked_to(tmp_path, capsys, monkeypatch):
    """The measure reaches the loops, the page and the document."""
    monkeypatch.setattr(answers, "Loops", lambda runs, *_: Loops(runs, 0))  # in this process
    rows = [f"{1e6 * a:.4f},{1e6 * b:.5f}" for a, b in zip(X, 5 * PROFILE.at(X), strict=True)]
    file = tmp_path / "t.csv"
    file.write_text("x (um),z (um)\n" + "\n".join(rows))
    words = ["trace", str(file), *CONTACT, "--quick", "--quiet", "--to", str(tmp_path / "out")]
    words = [*words, "--load-steps", "4", "--max-penetration", "0.3", "--accuracy", "1e-2"]
    assert main([*words, "--measure", "flat"]) == 0
    assert "(flat)" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "trace.json").read_text())
    assert found["measure"] == found["loop"]["measure"] == "flat"
    arc = of_the_answer_alone(
        make_cycle(HALF_SPACE, 0.04, 0.3, 4, "auto", 1e-2), prepare_trace(read_trace(file))
    )
    assert "(flat)" not in summary(arc)
    assert document_of(arc)["measure"] == "arc"
    m2 = found["loop"]["m2"]
    assert 0.02 * m2 < arc.loss.value / found["loop"]["loss"] - 1 < 2 * m2
