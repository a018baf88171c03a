"""Realisations in batches until the mean is known well enough: the rule, and its runs."""

import json
import math
import shutil

import numpy as np
import pytest

from adhesis.ensemble.aggregate.status import as_text, read_status
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.precision import (
    LEAST,
    MOST_LISTED,
    enough,
    estimates,
    fewest,
    interval,
    looks,
    precision,
    precision_lines,
)
from adhesis.ensemble.campaign.tables import growth
from adhesis.ensemble.command.main import main
from adhesis.ensemble.report import findings
from adhesis.ensemble.report.write_report import write_report
from adhesis.ensemble.results.checksum import row_checksums
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.results.schema import DONE, FAILED, NOT_NEEDED, PENDING
from adhesis.ensemble.results.write import DatasetRows
from tests.support import synthetic_results
from tests.support.campaign_support import (
    adhesis,
    adhesis_here,
    campaign_text,
    differences,
    differing,
    done_rows,
    kill_all,
    start,
    table_of,
    wait_until,
)
from tests.support.fake_run import run_file

STOP = "[stop]\nrelative_error = {}\nbatch = 4\nmost = {}\n"


def text(relative_error=0.2, most=80, quantity="", **changes):
    small = {"realisations": "8", "work_of_adhesion": "[0.04]", "load_steps": "1", "jumps": "1"}
    fields = "field_penetrations = []\nfield_realisations = 0\n"
    steered = f'quantity = "{quantity}"\n' if quantity else ""
    return campaign_text(**small, **changes) + fields + STOP.format(relative_error, most) + steered


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The campaign of ``text()``, undisturbed, by one process: its results file and its end."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "c.toml").write_text(text())
    return folder / "r.h5", run_file(folder / "c.toml", folder / "r.h5")


def test_the_rule_goes_by_the_interval_that_tables_print():
    values = np.random.default_rng(3).lognormal(0, 0.6, 40)
    (printed,) = estimates(values)
    furthest = max(printed.high - printed.mean, printed.mean - printed.low)
    known = precision(values, 0.2)
    assert known.estimate == printed
    assert printed.relative_error == pytest.approx(furthest / printed.mean, rel=1e-14)
    assert precision(values, 1.001 * printed.relative_error).narrow
    assert not precision(values, 0.999 * printed.relative_error).narrow
    assert precision(values[:1], 0.2).estimate.relative_error == np.inf
    assert precision(np.zeros(30), 0.2).estimate.relative_error == 0.0


def test_a_cell_is_described_with_quantity_both_ends_and_verdict():
    values = np.tile([0.9, 1.1], 20)
    for wanted, count, finished, verdict in (
        (0.05, 40, True, "met"),
        (0.02, 40, True, "not met"),
        (0.05, 40, False, "not finished"),
        (0.2, 8, True, "not met, as it takes at least 32 realisations"),
    ):
        known = precision(values[:count], wanted, "loss", finished=finished)
        assert known.met is {"met": True, "not finished": None}.get(verdict, False)
        error = f"{100 * known.estimate.relative_error:.3g}"
        assert str(known) == (
            f"loss {known.estimate.low:.4g} to {known.estimate.high:.4g} J/m² (± {error} %) "
            f"of {count} realisations, wanted ± {100 * wanted:g} %: {verdict}"
        )
    unknown = precision([np.nan, 1.0], 0.05, "loss")
    assert str(unknown).startswith("loss: interval unknown of 1 realisation, wanted ± 5 %: not met")
    met, not_met = precision(values, 0.05, "loss"), precision(values, 0.02, "loss")
    assert precision_lines([]) == []
    assert precision_lines([("A", met), ("B", not_met)]) == [
        "[stop]: 1 of 2 cells met the wanted precision",
        f"  A: {met}",
        f"  B: {not_met}",
    ]
    many = precision_lines([("A", met)] * MOST_LISTED + [("B", not_met)] * (MOST_LISTED + 5))
    assert many[1:-1] == [f"  B: {not_met}"] * MOST_LISTED
    assert "… and 5 more" in many[-1]


def test_a_cell_has_enough_at_four_looks_in_a_row_and_not_by_luck():
    rng = np.random.default_rng(2)
    losses = rng.normal(1, 0.2, 200)
    at = looks(8, 8, 200)
    stop = enough(losses, at, 0.05)
    row = [precision(losses[:n], 0.05).narrow for n in at if n <= stop]
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
    assert not precision(rare, 0.07).narrow
    assert enough(np.full(200, np.nan), at, 0.05) == 200  # all failed: there is an end


@pytest.mark.parametrize(
    ("first", "batch", "most", "count"),
    [(8, 8, 200, 56), (32, 8, 200, 56), (30, 8, 200, 62), (64, 16, 200, 112), (8, 8, 40, 40)],
)
def test_fewest_realisations_are_those_of_a_cell_without_any_spread(first, batch, most, count):
    at = looks(first, batch, most)
    assert fewest(at) == count
    assert enough(np.ones(most), at, 0.01) == count


@pytest.mark.parametrize(("spread", "wanted"), [(0.4, 0.1), (0.49, 0.05), (0.25, 0.05)])
def test_the_price_of_a_spread_is_what_the_rule_takes_in_the_median(spread, wanted):
    """To one batch: the interval is narrow when expected, and three more looks follow."""
    at, rng = looks(8, 8, 1000), np.random.default_rng(0)
    taken = [enough(rng.normal(1, spread, 1000), at, wanted) for _ in range(60)]
    assert abs(fewest(at, (1.96 * spread / wanted) ** 2) - np.median(taken)) <= 8


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
    """Four hundred campaigns of known mean 1: at least 93 % of the intervals hold it.

    More kinds of losses, and other wishes: benchmarks/precision_coverage.py.
    """
    rng, most = np.random.default_rng(7), 600
    at, held, counts = looks(16, 16, most), 0, []
    for _ in range(400):
        losses = draw(rng, most)
        count = enough(losses, at, wanted)
        assert count is not None
        low, high = interval(losses[:count])
        held += low <= 1 <= high
        counts.append(count)
    assert held >= 0.93 * 400
    assert np.median(counts) < 0.55 * most  # it is the rule that stops, not the end


@pytest.mark.parametrize("quantity", ["", "loss"])
def test_every_cell_gets_what_its_quantity_needs_and_no_more(tmp_path, quantity, finished, capsys):
    """By default that is the dimensionless loss, which has the interval of the table of losses."""
    path = tmp_path / "c.toml"
    path.write_text(text(quantity=quantity))
    out, summary = finished
    if quantity:
        out = tmp_path / "r.h5"
        summary = run_file(path, out)
    assert (summary.pending, summary.failed, summary.stopped) == (0, 0, None)
    steered = quantity or "loss_dimensionless"
    with Results(out) as results:
        assert results.campaign.stop.quantity == steered
        status = results.status()
        values = {name: results.column(name) for name in ("loss", "loss_dimensionless")}
    at = looks(8, 4, 80)
    needed = {
        name: [enough(mine, at, 0.2) for mine in np.split(column, 2)]
        for name, column in values.items()
    }
    assert needed["loss"] != needed["loss_dimensionless"]
    for i, count in enumerate(needed[steered]):
        mine = slice(80 * i, 80 * (i + 1))
        assert (status[mine][:count] == DONE).all()
        assert (status[mine][count:] == NOT_NEEDED).all()
        assert LEAST <= count < 80
    assert summary.done == sum(needed[steered])
    reported = json.loads(json.dumps(read_status(out)))
    assert reported["not_needed"] == 160 - summary.done
    assert main(["verify", str(out)]) == 0
    counts = f"({summary.done} done, 0 failed, {160 - summary.done} not needed), 0 are pending"
    assert counts in capsys.readouterr().out
    shown = as_text(reported)
    for group, (name, known), values_of in zip(
        reported["groups"], summary.precisions, np.split(values[steered], 2), strict=True
    ):
        assert name == f"H = {group['hurst']:g}, γ = 0.04 J/m²"
        assert known.met
        assert known.estimate.relative_error <= 0.2
        low, high = interval(values_of[: group["done"]])
        assert (known.estimate.low, known.estimate.high) == (low, high)
        assert (group["interval_low"], group["interval_high"]) == (low, high)
        assert group["relative_error"] == known.estimate.relative_error
        assert (group["quantity"], group["met"]) == (steered, True)
        assert str(known) in shown
    before = out.read_bytes()
    again = adhesis_here("run", path, "--out", out, fake="")
    assert out.read_bytes() == before
    assert precision_lines(summary.precisions)[1] in again.stderr.splitlines()


def test_rows_that_are_not_needed_are_marked_at_once_and_not_read(tmp_path, monkeypatch):
    """What a run writes and readers read does not grow with the most that a cell may take."""
    written, read = [], []
    write, of_rows = DatasetRows.write, row_checksums

    def writing(self, first, block):
        written.append(first)
        write(self, first, block)

    def reading(column, kept, rows):
        read.append(rows.size)
        return of_rows(column, kept, rows)

    monkeypatch.setattr(DatasetRows, "write", writing)
    monkeypatch.setattr("adhesis.ensemble.results.read.row_checksums", reading)
    counts = []
    for most in (80, 800):
        path, out = tmp_path / f"{most}.toml", tmp_path / f"{most}.h5"
        path.write_text(text(0.25, most, hurst="[0.7]"))
        written.clear()
        done = run_file(path, out).done
        read.clear()
        assert read_status(out)["not_needed"] == most - done
        assert read == [done]
        counts.append((done, len(written)))
    assert counts[0] == counts[1]
    # A wish for more makes them pending, and nothing more is written of those.
    path.write_text(text(0.2, 800, hurst="[0.7]"))
    written.clear()
    second = run_file(path, out)
    assert second.computed > 0
    assert len(written) < 100 * (1 + second.computed)


def test_a_cell_without_adhesion_has_enough_with_the_least_number(tmp_path):
    path, out = tmp_path / "c.toml", tmp_path / "r.h5"
    path.write_text(text(0.01, 60, hurst="[0.7]").replace("[0.04]", "[0.0, 0.04]"))
    summary = run_file(path, out)
    for group, (_, known) in zip(read_status(out)["groups"], summary.precisions, strict=True):
        is_lossless = group["work_of_adhesion"] == 0
        assert group["met"] is known.met is is_lossless
        assert group["done"] == (fewest(looks(8, 4, 60)) if is_lossless else 60)


def test_a_tighter_wish_or_more_realisations_go_on_from_there(tmp_path, finished):
    earlier, first = finished
    path, out, whole = tmp_path / "c.toml", tmp_path / "r.h5", tmp_path / "w.h5"
    shutil.copy(earlier, out)
    path.write_text(text(0.16))
    stopped = shutil.copy(earlier, tmp_path / "stopped.h5")
    run_file(path, stopped, fake="fail=*:*:*", max_failures=1)
    assert read_status(stopped)["pending"] > 0  # what is wanted now, though not before
    path.write_text(text(0.16, 120))
    second, alone = run_file(path, out), run_file(path, whole)
    assert second.computed == alone.computed - first.computed > 0
    assert differences(out, whole) == []


@pytest.mark.parametrize("quantity", ["loss_dimensionless", "loss"])
def test_the_report_has_the_interval_of_the_table_and_the_verdict_of_the_rule(
    tmp_path, capsys, no_figures, quantity
):
    """Of these losses the spread is 20 %, that of W~ 28 %: ± 9 % is met by the loss alone."""
    stop = f'[stop]\nrelative_error = 0.09\nmost = 40\nquantity = "{quantity}"\n'
    plan = parse_campaign(synthetic_results.text_of(hurst=(0.7,), realisations=40) + stop)
    values = synthetic_results.rows(plan)
    values["status"][70:] = PENDING
    out = synthetic_results.write(tmp_path / "r.h5", plan, values)
    data = write_report(out, tmp_path / "report")
    known = table_of(tmp_path / "report" / "precision.csv")
    printed = table_of(tmp_path / "report" / "losses.csv")
    unit = " [J/m^2]" if quantity == "loss" else ""
    for mine, table, group in zip(known, printed, read_status(out)["groups"], strict=True):
        assert mine["quantity"] == group["quantity"] == quantity
        for end in ("low", "high"):
            assert mine[f"ci_{end}"] == table[f"{quantity}_ci_{end}{unit}"]
            assert float(mine[f"ci_{end}"]) == group[f"interval_{end}"]
        assert float(mine["relative_error"]) == group["relative_error"]
    met = quantity == "loss"
    assert [mine["met"] for mine in known] == ["yes" if met else "no", "not finished"]
    assert [group["met"] for group in read_status(out)["groups"]] == [met, None]
    (sentence,) = findings.precision(data)
    assert f"interval of the mean {quantity} was to reach at most 9 % from it" in sentence
    assert f"{int(met)} of 2 cells met that" in sentence
    assert str(data.cells[1].precision) in sentence
    assert sentence in capsys.readouterr().out
    page = (tmp_path / "report" / "report.md").read_text(encoding="utf-8")
    assert "### Precision of the mean (`[stop]`)" in page
    assert "30 to 40 realisations by `[stop]`" in page


def test_failures_count_as_looked_at_and_may_be_computed_again(tmp_path):
    path, out = tmp_path / "c.toml", tmp_path / "r.h5"
    path.write_text(text(hurst="[0.7]"))
    summary = run_file(path, out, fake="fail=*:*:3", max_failures=math.inf)
    assert summary.failed == 1
    with Results(out) as results:
        assert np.sum(results.status() == FAILED) == 1
        assert PENDING not in results.status()


@pytest.mark.mpi
def test_ranks_and_kills_change_no_bit_of_a_precision_campaign(tmp_path, finished):
    path, out = tmp_path / "c.toml", tmp_path / "r.h5"
    path.write_text(text())
    process = start("run", path, "--out", out, ranks=3, fake="step=0.02")
    wait_until(lambda: done_rows(out) >= 20)
    kill_all(process)
    process.communicate()
    resumed = adhesis("run", path, "--out", out, ranks=2, fake="")
    assert resumed.returncode == 0, resumed.stderr
    assert differences(out, finished[0]) == []


def test_what_a_stop_may_be():
    old, new = parse_campaign(text()), parse_campaign(text(0.1, 100))
    assert set(growth("f", old, new)) == {"stop.relative_error", "stop.most"}
    assert len(differing(new, old)) == 2
    assert differing(parse_campaign(campaign_text(realisations="8")), old)
    spelt = parse_campaign(text(quantity="loss_dimensionless"))
    assert growth("f", old, spelt) == ()
    (phrase,) = differing(old, parse_campaign(text(quantity="loss")))
    assert phrase == "stop.quantity is 'loss' here and 'loss_dimensionless' there"
