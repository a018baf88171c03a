"""Realisations in batches until the mean is known well enough: the rule, and its runs."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from adhesis.ensemble.aggregate.statistics import estimates
from adhesis.ensemble.campaign.compare import compare
from adhesis.ensemble.campaign.file import load_campaign, parse_campaign
from adhesis.ensemble.campaign.precision import LEAST, enough, fewest, looks, narrow, relative_error
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.interval import interval
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE, FAILED, NOT_NEEDED, PENDING
from adhesis.ensemble.run.session import Options, run_campaign
from tests.support.campaign_support import (
    MPIRUN,
    adhesis,
    campaign_text,
    differences,
    done_rows,
    kill_all,
    start,
    wait_until,
)
from tests.support.fake_run import fake_engine

STOP = "[stop]\nrelative_error = {}\nbatch = 4\nmost = {}\n"


def text(relative_error=0.2, most=80, **changes):
    """Return a campaign of two cells, with little to write."""
    small = {"realisations": "8", "work_of_adhesion": "[0.04]", "load_steps": "1", "jumps": "1"}
    fields = "field_penetrations = []\nfield_realisations = 0\n"
    return campaign_text(**small, **changes) + fields + STOP.format(relative_error, most)


def run(path, out, fake="", **options):
    return run_campaign(
        load_campaign(path), out, None, Options(**options), engine=fake_engine(fake)
    )


# ---------------------------------------------------------------------- the rule


def test_the_rule_goes_by_the_interval_that_tables_print():
    values = np.random.default_rng(3).lognormal(0, 0.6, 40)
    (printed,) = estimates(values)
    furthest = max(printed.high - printed.mean, printed.mean - printed.low)
    assert relative_error(values) == pytest.approx(furthest / printed.mean, rel=1e-14)
    assert narrow(values, 1.001 * relative_error(values))
    assert not narrow(values, 0.999 * relative_error(values))
    assert relative_error(values[:1]) == np.inf
    assert relative_error(np.zeros(30)) == 0.0


def test_looks_are_after_the_first_and_every_batch():
    assert looks(8, 4, 20) == [8, 12, 16, 20]
    assert looks(8, 5, 20) == [8, 13, 18, 20]
    assert looks(8, 4, 8) == [8]


def test_a_cell_has_enough_at_four_looks_in_a_row_and_not_by_luck():
    rng = np.random.default_rng(2)
    losses = rng.normal(1, 0.2, 200)
    at = looks(8, 8, 200)
    stop = enough(losses, at, 0.05)
    assert stop is not None
    row = [narrow(losses[:n], 0.05) for n in at if n <= stop]
    assert row[-4:] == [True] * 4
    assert [True] * 4 not in [row[i : i + 4] for i in range(len(row) - 4)]
    assert enough(losses[: stop - 1], at, 0.05) is None  # decided on complete batches
    # Losses that happen to be alike do not stop a cell before the least number.
    assert enough(np.ones(16), at, 0.05) is None
    assert enough(np.ones(LEAST + 24), at, 0.05) == LEAST + 24
    # A few losses of a tail: Student's interval (± 6 %) takes no notice, this one keeps going.
    rare = np.ones(120)
    rare[::40] = 3
    assert 1.98 * rare.std(ddof=1) / np.sqrt(rare.size) / rare.mean() < 0.06
    assert not narrow(rare, 0.07)
    assert enough(np.full(200, np.nan), at, 0.05) == 200  # all failed: there is an end


def test_a_wide_look_starts_the_count_of_looks_again():
    """Two narrow looks lapse when a large loss makes the next one wide."""
    at = looks(8, 8, 200)
    losses = np.tile([0.9, 1.1], 100)
    losses[40] = 1.6  # seen first at the look at 48
    found = [narrow(losses[:n], 0.045) for n in at]
    assert found[:7] == [False, False, False, True, True, False, True]  # 8, 16, … 56 realisations
    assert all(found[6:])
    assert enough(losses, at, 0.045) == at[9]


@pytest.mark.parametrize(
    ("first", "batch", "most", "count"),
    [(8, 8, 200, 56), (32, 8, 200, 56), (30, 8, 200, 62), (64, 16, 200, 112), (8, 8, 40, 40)],
)
def test_fewest_realisations_are_those_of_a_cell_without_any_spread(first, batch, most, count):
    at = looks(first, batch, most)
    assert fewest(at) == count
    assert enough(np.ones(most), at, 0.01) == count


@pytest.mark.parametrize(
    ("draw", "wanted"),
    [
        (lambda rng, n: rng.normal(1, 0.25, n), 0.05),
        (lambda rng, n: rng.lognormal(-0.125, 0.5, n), 0.1),
        (lambda rng, n: rng.lognormal(-0.5, 1, n), 0.2),
        (lambda rng, n: 1 + 0.5 / np.sqrt(3) * rng.standard_t(3, n), 0.1),  # no third moment
    ],
    ids=["normal", "lognormal 0.5", "lognormal 1", "heavy tail"],
)
def test_intervals_at_the_stop_cover_the_mean(draw, wanted):
    """A thousand campaigns of known mean 1: at least 93 % of the intervals hold it.

    More kinds of losses, and other wishes: benchmarks/precision_coverage.py.
    """
    rng, most = np.random.default_rng(7), 600
    at, held, counts = looks(16, 16, most), 0, []
    for _ in range(1000):
        losses = draw(rng, most)
        count = enough(losses, at, wanted)
        assert count is not None
        low, high = interval(losses[:count])
        held += low <= 1 <= high
        counts.append(count)
    assert held >= 930
    assert np.median(counts) < 0.55 * most  # it is the rule that stops, not the end


# ---------------------------------------------------------------------- runs


def test_every_cell_gets_what_it_needs_and_no_more(tmp_path):
    path, out = tmp_path / "c.toml", tmp_path / "r.h5"
    path.write_text(text())
    summary = run(path, out)
    assert (summary.pending, summary.failed, summary.stopped) == (0, 0, None)
    with Results(out) as results:
        campaign, status, loss = results.campaign, results.status(), results.column("loss")
    at = looks(8, 4, 80)
    counts = []
    for i in range(2):
        mine = slice(80 * i, 80 * (i + 1))
        counts.append(enough(loss[mine], at, 0.2))
        assert (status[mine][: counts[-1]] == DONE).all()
        assert (status[mine][counts[-1] :] == NOT_NEEDED).all()
    assert min(counts) >= LEAST
    assert max(counts) < 80
    assert sum(counts) == summary.done
    assert campaign.realisations == 80
    told = json.loads(adhesis("status", out, "--json").stdout)
    assert told["not_needed"] == 160 - sum(counts)
    assert all(0 < g["relative_error"] <= 0.2 for g in told["groups"])
    assert ", enough" in adhesis("status", out).stdout
    before = out.read_bytes()
    assert run(path, out).computed == 0
    assert out.read_bytes() == before


def test_a_tighter_wish_or_more_realisations_go_on_from_there(tmp_path):
    path, out, whole = tmp_path / "c.toml", tmp_path / "r.h5", tmp_path / "w.h5"
    path.write_text(text())
    first = run(path, out)
    path.write_text(text(0.16, 120))
    second, alone = run(path, out), run(path, whole)
    assert second.computed == alone.computed - first.computed > 0
    assert differences(out, whole) == []


def test_failures_count_as_looked_at_and_may_be_computed_again(tmp_path):
    path, out = tmp_path / "c.toml", tmp_path / "r.h5"
    path.write_text(text())
    summary = run(path, out, fake="fail=*:*:3", max_failures=None)
    assert summary.failed == 2
    with Results(out) as results:
        assert np.sum(results.status() == FAILED) == 2
        assert PENDING not in results.status()


@pytest.mark.mpi
@pytest.mark.skipif(shutil.which(MPIRUN) is None, reason="there is no mpirun here")
def test_ranks_and_kills_change_no_bit_of_a_precision_campaign(tmp_path):
    path, out, whole = tmp_path / "c.toml", tmp_path / "r.h5", tmp_path / "w.h5"
    path.write_text(text())
    run(path, whole)
    two = tmp_path / "two.h5"
    assert adhesis("run", path, "--out", two, ranks=2, fake="").returncode == 0
    assert differences(two, whole) == []
    for rows in (10, 40):
        process = start("run", path, "--out", out, ranks=3, fake="step=0.02")
        wait_until(lambda rows=rows: done_rows(out) >= rows)
        kill_all(process)
        process.communicate()
    resumed = adhesis("run", path, "--out", out, ranks=3, fake="")
    assert resumed.returncode == 0, resumed.stderr
    assert differences(out, whole) == []


def test_what_a_stop_may_be(tmp_path):
    for changes, words in (
        ("[stop]\nbatch = 8\n", "[stop] relative_error is missing"),
        (STOP.format(0.1, 7), "[stop] most is 7: it must be at least realisations"),
        (STOP.format(1.5, 70), "relative_error is 1.5: it must be"),
    ):
        with pytest.raises(InputError) as caught:
            parse_campaign(campaign_text(realisations="8") + changes)
        assert words in str(caught.value)
    old, new = parse_campaign(text()), parse_campaign(text(0.1, 100))
    assert set(compare(old, new).grown) == {"stop.relative_error", "stop.most"}
    assert len(compare(new, old).other) == 2
    assert compare(parse_campaign(campaign_text(realisations="8")), old).other
    path = tmp_path / "c.toml"
    path.write_text(text())
    process = adhesis("run", path, "--part", "1/2", "--out", tmp_path / "p.h5")
    assert process.returncode == 2
    assert "its batches are decided on whole cells" in process.stderr
