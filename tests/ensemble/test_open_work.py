"""The work of adhesion of receding edges in commands, campaigns, results files and reports."""

import json

import numpy as np
import pytest

import adhesis
from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.report.findings import law, verdict
from adhesis.ensemble.report.tables.campaign_tables import losses
from adhesis.ensemble.task.compute import Runner
from adhesis.ensemble.task.doubt import beyond_zero_range
from adhesis.ensemble.trace.answer import check as check_trace
from adhesis.ensemble.trace.answer import make_cycle
from adhesis.ensemble.trace.prepare import prepare_trace
from adhesis.ensemble.trace.reading.measured_trace import Trace
from adhesis.ensemble.trace.variants import make_plan
from tests.support.campaign_support import adhesis_here, campaign_text, table_of
from tests.support.scenes import HALF_SPACE
from tests.support.synthetic_results import rows, text_of, write

ROUGH = ("--hurst", 0.8, "--seed", 1, "--n0", 2, "--ratio", 4, "--accuracy", 1e-2)


def text(value: str, **changes: str) -> str:
    given = campaign_text(poisson=f"0.5\nwork_of_adhesion_open = {value}", **changes)
    return given.replace('method = "grid"\nnodes_per_wave = 16\n', "accuracy = 1e-2\n")


def test_a_loop_lists_friction_and_instability(tmp_path):
    out = tmp_path / "loop.json"
    words = ("--work-of-adhesion", "40mJ/m2", "--work-of-adhesion-open", "80mJ/m2", "--quiet")
    path = ("--max-penetration", 0.5, "--load-steps", 6)
    done = adhesis_here("loop", *ROUGH, *path, *words, "--json", out)
    assert done.returncode == 0, done.stderr
    data = json.loads(out.read_text())
    assert (data["work_of_adhesion"], data["work_of_adhesion_open"]) == (0.04, 0.08)
    assert 0 < data["friction"] < data["loss"]
    assert data["loss"] == pytest.approx(data["loss_from_drops"], rel=1e-3)
    drops = sum(jump["energy_drop"] for jump in data["jumps"])
    assert drops < 0.99 * data["loss"]  # the rest is friction between jumps
    assert data["provenance"]["units"]["friction"] == "J/m²"
    assert np.all(np.diff([state["edge_friction"] for state in data["states"]]) >= 0)
    line = f"friction    {data['friction']:.6g} J/m² at edges, which recede at 0.08 J/m²; "
    line += f"{data['loss'] - data['friction']:.6g} J/m² lost by instability"
    assert line in done.stdout.splitlines()


def small_trace():
    x = np.arange(100) / 100 * 1e-3
    heights = 1e-6 * np.sin(2 * np.pi * 3 * x / 1e-3) + 3e-7 * np.sin(2 * np.pi * 7 * x / 1e-3 + 1)
    return prepare_trace(Trace(heights, 1e-5, "t.txt"))


def test_the_table_of_a_trace_keeps_the_ratio_of_both_works_of_adhesion():
    cycle = make_cycle(
        HALF_SPACE, 0.04, 0.3, 4, "auto", 1e-3, work_of_adhesion_open=0.06
    )  # below the 0.08 of the table
    prepared = small_trace()
    check_trace(prepared, cycle)
    plan = make_plan(prepared, cycle, processes=0)
    problems = [cycle.problem(run.profile, run.work_of_adhesion) for run in plan.runs]
    found = {(problem.work_of_adhesion, problem.gamma_open) for problem in problems}
    assert found == {(0.04, 0.06), (0.02, 0.03), (0.08, 0.12)}


def test_the_answer_of_a_trace_has_its_friction():
    answer = adhesis.loss_of_trace(
        small_trace(),
        half_space=HALF_SPACE,
        work_of_adhesion=0.01,
        work_of_adhesion_open=0.02,
        max_penetration=0.3,
        load_steps=4,
        quick=True,
        processes=0,
    )
    assert 0 < answer.main["friction"] < answer.main["loss"]
    assert answer.main["work_of_adhesion_open"] == 0.02
    assert "\nfriction    " in str(answer)
    assert "which recede at 0.02 J/m²" in str(answer)
    loss, friction = answer.loss.value, answer.main["friction"]
    assert f"friction    {friction:.3g} J/m² at edges" in str(answer)  # it is known to 2 % at best
    assert f", {loss / answer.cycle.works_of_adhesion[0]:.3g} γ" in str(answer)


def test_a_row_has_its_friction():
    campaign = parse_campaign(text("0.08", work_of_adhesion="[0.04]", hurst="[0.8]"))
    row = Runner()(campaign, campaign.tasks()[0])
    assert row["gamma_open"] == 0.08
    assert 0 < row["friction"] < row["loss"]
    assert row["loss_from_drops"] == pytest.approx(row["loss"], rel=1e-3)
    assert row["loss_small_scale"] + row["loss_large_scale"] < 0.99 * row["loss"]


def test_a_loss_is_doubted_by_the_work_of_adhesion_that_it_spends():
    """Twenty times the work of adhesion of the largest contact bound it, that of opening."""
    values = {
        "valid_range": 1.0, "loss": 1.0, "work_of_adhesion": 0.04, "largest_contact_fraction": 0.5,
        "opening_strength": np.inf, "edge_range": 1.0, "touch_range": 1.0,
        "turn_range": np.inf,
    }  # fmt: skip
    assert beyond_zero_range(values | {"gamma_open": 0.04})
    assert not beyond_zero_range(values | {"gamma_open": 0.4})
    assert beyond_zero_range(values | {"gamma_open": np.nan})
    values |= {"gamma_open": 0.04, "pull_off_stress": 10.0}
    assert not beyond_zero_range(values, stiffness=60.0)  # stores 0.83 J/m² of the 1 at pull-off
    assert beyond_zero_range(values, stiffness=600.0)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Aggregates of a campaign with the key as an axis, and of one without."""
    folder = tmp_path_factory.mktemp("open")
    found = []
    for name, key in (("open", "\nwork_of_adhesion_open = [0.05, 0.08]"), ("one", "")):
        plan = parse_campaign(
            text_of(realisations=2).replace("poisson = 0.5", f"poisson = 0.5{key}")
        )
        values = rows(plan)
        if key:
            values["friction"] = 0.25 * values["loss"]
            values["loss_from_drops"] = 2.0 * values["loss"]  # half is friction between the jumps
            values["gamma_open"] = values["work_of_adhesion_open"]
        found.append(aggregate(write(folder / f"{name}.h5", plan, values)))
    return found


def test_the_table_of_losses_has_both_parts_where_the_key_is_given(both, tmp_path):
    tables = []
    for data in both:
        losses(data).write_csv(tmp_path / "losses.csv")
        tables.append(table_of(tmp_path / "losses.csv"))
    opened, (one, *_) = tables
    new = ["friction_mean [J/m^2]", "instability_mean [J/m^2]"]
    assert [name for name in opened[0] if name in new] == new
    assert "work_of_adhesion_open [J/m^2]" in opened[0]
    for row in opened:
        loss = float(row["loss_mean [J/m^2]"])
        assert float(row[new[0]]) == pytest.approx(0.25 * loss)
        assert float(row[new[1]]) == pytest.approx(0.75 * loss)
    assert not set(new) & set(one)


def test_the_report_says_which_part_is_friction(both):
    opened, one = ("\n".join(verdict(data)) for data in both)
    assert "% of the drops are lost where edges run inside patches; " in opened
    assert "; friction of receding edges is 25 % of the loss." in opened
    values = both[0].cells[0].values
    share = values["small_scale_share"] / (1 - values["small_scale_share"])
    assert share == pytest.approx(values["loss_small_scale"] / values["loss_large_scale"])
    assert "friction" not in one
    said = [list(law(data)) for data in both]
    assert said == [
        ["Edges advance at γ, and recede at a work of adhesion of 0.05 to 0.08 J/m²."],
        [],
    ]
    assert "friction and instability: parts of the loss, in mJ/m²; " in losses(both[0]).notes()
