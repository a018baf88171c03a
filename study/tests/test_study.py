"""Methods of the study, on losses whose answer is known.

``python -m study page`` checks that the numbers of the pages are what the data make.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from adhesis import HalfSpace, Problem, run_loop, self_affine_profile
from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.report.paper import TABLE_1
from adhesis.ensemble.results.schema import DONE, FAILED, PENDING
from study import amplitude, coarse, jumps, monotone
from study.collect import COLUMNS, _chosen, collect_all, without_detached
from study.data import Rows, Study, read
from study.measure import Reading, Sample
from study.page import filled, write_pages
from study.readings import Losses
from study.text import mean_text, p_equals, p_text
from tests.support.scenes import grid_of

STUDY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def study():
    return Study.at(STUDY)


def test_the_results_are_those_of_the_campaigns(study):
    """Every loop belongs to a campaign of the page, with its values."""
    campaigns = {path.stem: load_campaign(path) for path in (STUDY / "campaigns").glob("*.toml")}
    assert set(study.loops["campaign"].tolist()) <= set(campaigns)
    for name, campaign in campaigns.items():
        rows = study.loops.where(campaign=name)
        assert set(rows["hurst"].tolist()) <= set(campaign.sweep.hurst)
        assert set(rows["work_of_adhesion"].tolist()) <= set(campaign.sweep.work_of_adhesion)
        assert len(rows) <= campaign.task_count


def drawn(rng, realisations, means, spread=0.3):
    """Losses of correlated cells: a common factor of each profile, and one of each cell."""
    common = rng.lognormal(0, spread, realisations)
    own = rng.lognormal(0, spread / 2, (len(means), realisations))
    losses = common * own
    return np.array(means)[:, None] * losses / np.exp(0.5 * spread**2 * 1.25)


def test_the_right_reading_is_compatible_and_one_of_other_losses_is_not(monkeypatch):
    monkeypatch.setattr("study.measure.DRAWS", 5_000)
    rng = np.random.default_rng(1)
    cells, paper = tuple(TABLE_1), list(TABLE_1.values())
    right = [Reading("", Sample(cells, drawn(rng, 16, paper))) for _ in range(20)]
    shifted = np.array(paper) * np.where([c == (0.8, 0.07) for c in cells], 0.4, 1.0)
    wrong = [Reading("", Sample(cells, drawn(rng, 16, shifted))) for _ in range(20)]
    many = [Reading("", Sample(cells, drawn(rng, 100, shifted))) for _ in range(5)]
    assert sum(reading.verdict == "compatible" for reading in right) >= 17
    assert all(reading.verdict != "compatible" for reading in wrong)
    assert all(reading.verdict == "excluded" for reading in many)
    assert all(reading.worst == (0.8, 0.07) for reading in (*wrong, *many))


@pytest.mark.parametrize("factors", ["none", "one a row"])
@pytest.mark.parametrize("realisations", [7, 16])
def test_right_readings_have_a_small_probability_no_more_often_than_it_says(
    monkeypatch, realisations, factors
):
    """Also with few loops, whose covariance is uncertain: of normal draws 6 % are below 0.01."""
    monkeypatch.setattr("study.measure.DRAWS", 2_000)
    rng = np.random.default_rng(3)
    cells, paper = tuple(TABLE_1), np.array(list(TABLE_1.values()))
    found = []
    for _ in range(300):
        ours = drawn(rng, realisations, np.ones(8))
        theirs = drawn(rng, 10, np.ones(8)).mean(axis=1)
        sample = Sample(cells, paper[:, None] * ours / theirs[:, None])
        found.append(Reading("", sample, factors=factors).p)
    for p in (0.01, 0.05, 0.1):
        assert np.mean(np.array(found) < p) < p + 3 * np.sqrt(p * (1 - p) / 300)
    assert 0.3 < np.mean(np.array(found) < 0.5) < 0.6  # nor are they all large


def test_the_probability_over_some_cells_is_that_of_a_reading_of_these():
    rng = np.random.default_rng(5)
    cells, paper = tuple(TABLE_1), np.array(list(TABLE_1.values()))
    losses = drawn(rng, 12, 1.2 * paper)
    some = cells[2:6]
    largest, p = Reading("", Sample(cells, losses)).over(some)
    alone = Reading("", Sample(some, losses[2:6]))
    assert largest == pytest.approx(alone.largest)
    assert p == pytest.approx(alone.p, abs=0.02)


def test_a_cell_that_lacks_realisations_has_fewer_degrees_of_freedom():
    """The same deviation in units of its standard deviation is less rare with fewer loops."""
    rng = np.random.default_rng(6)
    cells = tuple(TABLE_1)
    losses = drawn(rng, 16, np.ones(8))
    few = losses.copy()
    few[4, 6:] = np.nan
    shares = [
        float(np.mean(Sample(cells, one).drawn("none", 0.8)[:, 4] > 4)) for one in (losses, few)
    ]
    assert 0 < 3 * shares[0] < shares[1]


def test_a_free_unit_of_the_loss_is_found():
    """Of losses in another unit, one for all or one a row, factors and verdict are found."""
    rng = np.random.default_rng(8)
    cells, paper = tuple(TABLE_1), np.array(list(TABLE_1.values()))
    rows = np.array([{0.7: 1.9, 0.8: 1.7, 0.9: 1.2}[hurst] for hurst, _ in cells])
    one = Reading("", Sample(cells, drawn(rng, 100, paper / 1.6)))
    each = Reading("", Sample(cells, drawn(rng, 100, paper / rows)))
    for reading in (one, each, replace(each, factors="one")):
        assert reading.verdict != "compatible"
    assert replace(one, factors="one").verdict == "compatible"
    assert replace(one, factors="one").fitted == pytest.approx([1.6], rel=0.1)
    assert replace(each, factors="one a row").verdict == "compatible"
    assert replace(each, factors="one a row").fitted == pytest.approx([1.9, 1.7, 1.2], rel=0.1)


def test_what_cannot_be_resolved_is_not_printed():
    assert (p_text(1e-98), p_text(0.0123)) == ("< 1e-6", "0.012")
    assert (p_text(0.0, 1 / 20_000), p_equals(1e-9)) == ("< 5e-5", "p < 1e-6")
    assert (mean_text(np.array([1.0])), mean_text(np.array([1.0, 2.0]))) == ("", "")
    assert mean_text(np.array([1.0, 2.0, 3.0])).startswith("2 (")


def test_a_page_that_is_not_what_the_data_make_is_named_and_mended(tmp_path, monkeypatch):
    monkeypatch.setattr("study.page.ALL", {"one": lambda _: "right"})
    monkeypatch.setattr("study.page.all_readings", lambda _: (["a \\|z\\|"], [["1"]]))
    monkeypatch.setattr("study.page.Study.at", lambda _: None)
    (tmp_path / "data").mkdir()
    listed = tmp_path / "data" / "readings.csv"
    listed.write_text("a |z|\n1\n", encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text("x\n<!-- table one -->\nwrong\n<!-- end -->\n", encoding="utf-8")
    assert write_pages(tmp_path) == [page]
    assert page.read_text("utf-8") == "x\n<!-- table one -->\nright\n<!-- end -->\n"
    assert write_pages(tmp_path) == []
    assert filled("no table", None) == "no table"


def amplitudes(peak, realisations, rng, spread=0.1):
    """Loops of one H and turning point whose mean loss has a maximum at a height."""
    rows = {name: [] for name in COLUMNS}
    for height, count in zip((0.25, 0.5, 1.0, 2.0, 4.0), realisations, strict=True):
        for realisation in range(count):
            loss = np.exp(-0.5 * np.log(height / peak) ** 2 + spread * rng.standard_normal())
            row = dict.fromkeys(COLUMNS, np.nan) | {
                "campaign": "amplitude", "status": "done", "hurst": 0.8, "work_of_adhesion": 0.04,
                "max_penetration": 0.8, "h_rms": 1e-6 * height, "loss": loss,
                "realisation": realisation,
            }  # fmt: skip
            for name in COLUMNS:
                rows[name].append(row[name])
    loops = Rows({name: np.array(column) for name, column in rows.items()})
    return Study(loops, loops.where(status="failed"), loops, loops)


def test_the_maximum_through_the_amplitude_is_located():
    rng = np.random.default_rng(4)
    places, _, ends = amplitude.vertices(
        np.array([1.0, 2.0, 8.0]), np.exp([[0.0, 1.0, 0.5], [3.0, 2.0, 1.0]])
    )
    curve = np.polyfit(np.log([1.0, 2.0, 8.0]), [0.0, 1.0, 0.5], 2)
    assert places == pytest.approx([np.exp(-curve[1] / (2 * curve[0])), 1.0])
    assert ends.tolist() == [False, True]
    held = 0
    for _ in range(20):
        found = amplitude.maximum(amplitudes(1.3, (40, 40, 40, 25, 10), rng), 0.8, 0.8)
        assert found.height == pytest.approx(1.3, rel=0.2)
        assert found.at_end == 0
        held += found.low <= 1.3 <= found.high
    assert held >= 16
    beyond = amplitude.maximum(amplitudes(30, (10,) * 5, rng), 0.8, 0.8)
    assert (beyond.height, beyond.at_end) == (4.0, 1.0)


def test_a_rise_and_a_fall_through_the_amplitude_are_seen():
    rng = np.random.default_rng(4)
    ((_, row),) = amplitude.rows(amplitudes(1.3, (20,) * 5, rng), "loss")
    assert row.verdict == "not monotone"
    assert row.p_not_monotone < 1e-6
    ((_, row),) = amplitude.rows(amplitudes(30, (20,) * 5, rng), "loss")
    assert row.verdict == "rises"
    assert row.p_monotone < 1e-3
    assert row.p_not_monotone > 0.5


def test_the_law_of_scaling_decides_no_verdict(study):
    """Losses at another γ, corrected by what the law is off at their height, give the same."""
    off = max(abs(one.mean) for one in amplitude.scaling(study) if one.height <= 2)
    assert 0 < off < 0.02
    verdicts = {(h, row.turn): row.verdict for h, row in amplitude.rows(study, "loss")}
    for factor in (1 + off, 1 - off):
        columns = dict(study.loops.columns)
        scaled = np.isin(columns["campaign"], amplitude.KNOWN) & (
            columns["work_of_adhesion"] != amplitude.GAMMA
        )
        columns["loss"] = np.where(scaled, factor * columns["loss"], columns["loss"])
        changed = replace(study, loops=Rows(columns))
        found = {(h, row.turn): row.verdict for h, row in amplitude.rows(changed, "loss")}
        assert found == verdicts


@pytest.mark.parametrize(("name", "kept"), [("amplitude", [0, 1]), ("amplitude_same", [0, 1, 2])])
def test_realisations_that_a_cell_lacks_are_left_out(name, kept):
    """Of two cells and two realisations, one loop failed and one is pending."""
    results = SimpleNamespace(
        status=lambda: np.array([DONE, FAILED, DONE, PENDING]),
        column=lambda _: np.array([0, 0, 1, 1]),
    )
    assert _chosen(results, name) == kept


def test_a_campaign_without_results_keeps_its_rows(tmp_path):
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "campaigns" / "one.toml").touch()
    before = {"campaign": "one", "hurst": "0.8", "loss": "0.5"}
    lines = [",".join(before), ",".join(before.values()), "gone,0.7,0.1"]
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "loops.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    collect_all(tmp_path / "results", tmp_path)
    rows = read(tmp_path / "data" / "loops.csv")
    assert rows["campaign"].tolist() == ["one"]
    assert rows["loss"].tolist() == [0.5]
    assert set(rows.columns) == set(COLUMNS)


def test_losses_of_higher_profiles_are_those_of_a_weaker_adhesion(study):
    """At a factor that leads to a work of adhesion that was computed they are its losses."""
    losses = Losses(study)
    there = losses.direct("loss_dimensionless", 0.8, 0.04, 0.8, 100)
    found = losses.scaled("loss_dimensionless", 0.8, 0.07, 0.8, 100, 0.07 / 0.04)
    assert len(found) >= 5
    assert found == pytest.approx({r: there[r] for r in found})
    assert losses.scaled("loss_dimensionless", 0.8, 0.04, 0.8, 100, 1e3) == {}


def test_detached_realisations_are_left_out_of_the_average():
    """Of two that pull equally, the one that holds longer counts alone where the other is apart."""
    up = np.linspace(1.0, -4.0, 501)
    down, load = np.array([0.0, 1.0]), np.zeros((2, 2))
    in_contact = np.array([up >= -1, up >= -3])
    values = without_detached(down, load, up, -2.0 * in_contact, in_contact)
    assert values.mean() == pytest.approx(8.0, rel=5e-3)
    assert values == pytest.approx([6.0, 10.0], rel=1e-2)  # without one, W~ is that of the other
    alike = in_contact[[0, 0]]
    assert without_detached(down, load, up, -2.0 * alike, alike) == pytest.approx(4.0, rel=1e-2)
    with pytest.raises(ValueError, match="before its realisation has detached"):
        without_detached(down, load, up[:300], -2.0 * in_contact[:, :300], in_contact[:, :300])


def test_coarse_steps_become_the_path_of_the_method_grid():
    profile = self_affine_profile(0.8, period=1e-3, n0=2, ratio=6, h_rms=1e-6, seed=5)
    problem = Problem(profile, HalfSpace(1e6, 0.5), 0.02)
    right = run_loop(grid_of(problem, nodes=256), max_penetration=0.6, load_steps=6)
    fine, long = coarse.loops(problem, 256, (0.6,), 0.02, (0.02, 0.6))
    assert fine["loss_dimensionless"] == pytest.approx(right.loss_dimensionless, rel=0.01)
    assert fine["pull_off_stress"] == pytest.approx(right.pull_off_stress, rel=0.02)
    errors = [abs(row["loss_dimensionless"] - right.loss_dimensionless) for row in (fine, long)]
    assert errors[0] < errors[1]


def table_of(values, groups=8):
    rng = np.random.default_rng(0)
    return Rows(
        {
            "hurst": np.full(values.size, 0.8),
            "realisation": rng.integers(groups, size=values.size).astype(float),
            "energy_drop": values,
        }
    )


def test_a_power_law_is_found_where_it_begins():
    rng = np.random.default_rng(5)
    tail = 1e-3 * rng.random(1500) ** (1 / (1 - 2.2))
    rest = 1e-3 * rng.random(700) ** 0.5
    law = jumps.power_law(table_of(np.concatenate([tail, rest])), "energy_drop")
    assert law.low < 2.2 < law.high
    assert 0.7e-3 < law.smallest < 3e-3
    assert law.p > 0.05
    other = jumps.power_law(table_of(rng.lognormal(-7, 0.8, 3000)), "energy_drop")
    assert other.p < 0.05 or other.n < 1000


def test_a_power_law_with_a_cut_off_is_found():
    rng = np.random.default_rng(6)
    x = 1e-4 * rng.random(200_000) ** (1 / (1 - 1.4))
    kept = x[rng.random(x.size) < np.exp(-x / 1e-2)][:4000]
    law = jumps.cut_power_law(table_of(kept), "energy_drop", np.log10(kept.max() / 1e-4))
    assert law.low - 0.02 < 1.4 < law.high + 0.02
    assert law.cut == pytest.approx(1e-2, rel=0.3)
    assert law.distance < 0.03


def test_verdicts_on_monotony_are_those_decided():
    def row(*steps):
        made = [monotone.Step((0.9, 0.8), 0.1, 0.0, 0.2, rise, fall, 9) for rise, fall in steps]
        return monotone.Row(0.04, 0.8, "loss", tuple(made)).verdict

    assert row((0.01, 1.0), (0.02, 1.0)) == "rises"
    assert row((1.0, 0.01), (1.0, 0.02)) == "falls"
    assert row((1.0, 0.01), (1.0, 0.04)) == "open"
    assert row((0.01, 1.0), (1.0, 0.01)) == "not monotone"
    assert row((0.01, 1.0), (0.2, 0.8)) == "open"
    assert monotone.Step((0.9, 0.8), 0.1, 0.0, 0.2, 0.02, 0.98, 9).p == 0.04
    assert monotone._holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
