"""The study's page: every number follows from the small tables, by methods that find what is known.

``docs/study/README.md`` says what was decided before; here it is held that its tables are those
that its program makes, and that the program can tell a right reading from a wrong one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.report.paper import TABLE_1
from tools.study import jumps, monotone
from tools.study.data import Rows, Study
from tools.study.page import ALL, filled
from tools.study.readings import Losses, Reading

STUDY = Path(__file__).resolve().parents[2] / "docs" / "study"
PAGE = (STUDY / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def study():
    return Study.at(STUDY)


@pytest.mark.parametrize("name", ALL)
def test_every_table_of_the_page_is_what_the_results_make(study, name):
    place = PAGE.split(f"<!-- table {name} -->")[1].split("<!-- end -->")[0]
    mark = f"<!-- table {name} -->{place}<!-- end -->"
    assert len(place) > 100
    assert filled(mark, study) == mark


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


def test_the_right_reading_is_compatible_and_one_of_other_losses_is_excluded(monkeypatch):
    monkeypatch.setattr("tools.study.readings.DRAWS", 20_000)
    rng = np.random.default_rng(1)
    cells, paper = tuple(TABLE_1), list(TABLE_1.values())
    right = [Reading("", cells, drawn(rng, 16, paper)) for _ in range(20)]
    shifted = np.array(paper) * np.where([c == (0.8, 0.07) for c in cells], 0.4, 1.0)
    wrong = [Reading("", cells, drawn(rng, 16, shifted)) for _ in range(20)]
    assert sum(reading.verdict == "compatible" for reading in right) >= 17
    assert sum(reading.verdict == "excluded" for reading in wrong) >= 17
    assert all(reading.worst == (0.8, 0.07) for reading in wrong)


def test_the_probability_of_a_reading_is_that_of_its_draws(monkeypatch):
    """Of papers that were drawn from a reading itself, one in ten has p below 0.1."""
    monkeypatch.setattr("tools.study.readings.DRAWS", 10_000)
    rng = np.random.default_rng(3)
    cells, paper = tuple(TABLE_1), np.array(list(TABLE_1.values()))
    counts = []
    for _ in range(100):
        ours, theirs = drawn(rng, 16, np.ones(8)), drawn(rng, 10, np.ones(8)).mean(axis=1)
        counts.append(Reading("", cells, paper[:, None] * ours / theirs[:, None]).p)
    assert 0.02 <= np.mean(np.array(counts) < 0.1) <= 0.22


def test_losses_of_higher_profiles_are_those_of_a_weaker_adhesion(study):
    """At a factor that leads to a work of adhesion that was computed they are its losses."""
    losses = Losses(study)
    there = losses.direct("loss_dimensionless", 0.8, 0.04, 0.8, 100)
    found = losses.scaled("loss_dimensionless", 0.8, 0.07, 0.8, 100, 0.07 / 0.04)
    assert len(found) >= 5
    assert found == pytest.approx({r: there[r] for r in found})
    assert losses.scaled("loss_dimensionless", 0.8, 0.04, 0.8, 100, 1e3) == {}


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
        made = [
            monotone.Step((0.9, 0.8), 0.1, 0.0, 0.2, rise, fall, 9)
            for rise, fall in steps
        ]
        return monotone.Row(0.04, 0.8, "loss", tuple(made)).verdict

    assert row((0.01, 1.0), (0.02, 1.0)) == "rises"
    assert row((1.0, 0.01), (1.0, 0.02)) == "falls"
    assert row((1.0, 0.01), (1.0, 0.04)) == "open"
    assert row((0.01, 1.0), (1.0, 0.01)) == "not monotone"
    assert row((0.01, 1.0), (0.2, 0.8)) == "open"
    assert monotone._holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
