"""Averages of a results file against the raw rows, with plain numpy; error bars that cover."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from adhesis.ensemble.aggregate.average import BIN_EDGES, QUANTILES, SMALL, aggregate, fitted_slope
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.precision import estimates, interval, interval_method, untransformed
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.read import Results
from adhesis.ensemble.task.fields import FieldPlan
from adhesis.solver.model.jump import JUMP_KINDS
from tests.support.campaign_support import run_python
from tests.support.synthetic_results import campaign, rows, sign, text_of, write

E_STAR, Q0 = 1e6 / 0.75, 1000.0


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    """A campaign of 24 tasks: 19 done, 2 failed, 3 pending, one cell with a single result."""
    plan = campaign(hurst=(0.7, 0.8), gamma=(0.01, 0.04), realisations=6)
    values = rows(plan)
    values["status"][[2, 3]] = 2
    values["status"][[7, 8, 9]] = 0
    values["error"] = np.zeros(24, dtype="S512")
    values["error"][2] = "γ diverged".encode()
    return write(tmp_path_factory.mktemp("aggregate") / "r.h5", plan, values)


def raw(file: Path, hurst: float, gamma: float) -> tuple[h5py.File, np.ndarray]:
    data = h5py.File(file, "r")
    mine = (data["hurst"][:] == hurst) & (data["work_of_adhesion"][:] == gamma)
    return data, np.flatnonzero(mine & (data["status"][:] == 1))


CELLS = [(0.7, 0.01, 4, 2, 0), (0.7, 0.04, 3, 0, 3), (0.8, 0.01, 6, 0, 0), (0.8, 0.04, 6, 0, 0)]


@pytest.mark.parametrize(("hurst", "gamma", "done", "failed", "pending"), CELLS)
def test_scalars_are_the_means_of_the_raw_rows(file, hurst, gamma, done, failed, pending):
    cell = aggregate(file).finished([hurst], [gamma])[0]
    assert (cell.done, cell.failed, cell.pending) == (done, failed, pending)
    data, mine = raw(file, hurst, gamma)
    for name in (
        "loss",
        "loss_dimensionless",
        "loss_small_scale",
        "pull_off_stress",
        "m2",
        "h_max",
    ):
        values = data[name][:][mine]
        found = cell.estimates[name]
        assert found.n == done
        assert found.mean == pytest.approx(values.sum() / done, rel=1e-13)
        std = np.sqrt(((values - values.mean()) ** 2).sum() / (done - 1))
        assert found.std == pytest.approx(std, rel=1e-9, abs=1e-20)
        assert found.sem == pytest.approx(std / np.sqrt(done), rel=1e-9, abs=1e-20)
    loss = cell.estimates["loss"]
    assert loss.low < loss.mean < loss.high


@pytest.mark.parametrize(("hurst", "gamma"), [cell[:2] for cell in CELLS])
def test_curves_are_the_means_of_the_raw_rows(file, hurst, gamma):
    cell = aggregate(file).finished([hurst], [gamma])[0]
    data, mine = raw(file, hurst, gamma)
    h_max, m2 = data["h_max"][:][mine], data["m2"][:][mine]
    for branch in ("loading", "unloading"):
        stress = data[f"{branch}_mean_stress"][:][mine]
        sigma = 2 * stress / (E_STAR * Q0 * h_max[:, None])
        area = data[f"{branch}_contact_fraction"][:][mine]
        for name, values in (
            ("mean_stress", stress),
            ("mean_stress_dimensionless", sigma),
            ("mean_stress_over_slope", sigma / np.sqrt(m2)[:, None]),
            ("contact_fraction", area),
            ("patches", data[f"{branch}_patches"][:][mine]),
        ):
            found = cell.curves[f"{branch}_{name}"]
            np.testing.assert_allclose(found.mean, values.mean(axis=0), rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(found.std, values.std(axis=0, ddof=1), rtol=1e-9, atol=1e-9)
            ordered = np.sort(values, axis=0)
            middle = 0.5 * (ordered[(len(mine) - 1) // 2] + ordered[len(mine) // 2])
            median = found.quantiles[QUANTILES.index(0.5)]
            np.testing.assert_allclose(median, middle, rtol=1e-12, atol=1e-12)


def test_blocks_of_any_size_give_the_same_numbers(file, monkeypatch):
    whole = aggregate(file)
    monkeypatch.setattr(
        "adhesis.ensemble.aggregate.average.HELD_AT_ONCE", 18
    )  # 3 columns of 6 rows
    monkeypatch.setattr("adhesis.ensemble.aggregate.average.READ_AT_ONCE", 100)
    pieces = aggregate(file)
    for one, two in zip(whole.cells, pieces.cells, strict=True):
        for name, curve in one.curves.items():
            np.testing.assert_array_equal(curve.mean, two.curves[name].mean)
            np.testing.assert_array_equal(curve.quantiles, two.curves[name].quantiles)
        np.testing.assert_array_equal(one.jumps.histogram, two.jumps.histogram)
        np.testing.assert_allclose(
            one.fields.psd_displacement, two.fields.psd_displacement, rtol=1e-12
        )


def test_differences_across_gamma_are_taken_profile_by_profile(file):
    found = aggregate(file).paired
    assert [(p.lower.work_of_adhesion, p.upper.work_of_adhesion) for p in found] == 2 * [
        (0.01, 0.04)
    ]
    pairs = {pair.lower.hurst: pair.loss.difference for pair in found}
    assert set(pairs) == {0.7, 0.8}
    data = h5py.File(file, "r")
    loss = data["loss"][:]
    both = [r for r in range(6) if data["status"][r] == 1 and data["status"][6 + r] == 1]
    expected = [loss[6 + r] - loss[r] for r in both]
    assert pairs[0.7].n == len(both) == 3 - sum(r in (2, 3) for r in (0, 4, 5))
    assert pairs[0.7].mean == pytest.approx(np.mean(expected))
    expected = loss[18:24] - loss[12:18]
    assert pairs[0.8].mean == pytest.approx(expected.mean())
    assert pairs[0.8].std == pytest.approx(expected.std(ddof=1))


def test_jumps_are_counted_by_kind_and_energy(file):
    cells = aggregate(file).cells
    for cell, (hurst, gamma, *_) in zip(cells, CELLS, strict=True):
        found = cell.jumps
        data, mine = raw(file, hurst, gamma)
        kind, drop = data["jump_kind"][:][mine].ravel(), data["jump_energy_drop"][:][mine].ravel()
        for j, name in enumerate(JUMP_KINDS):
            assert SMALL[j] == (name in ("spreading", "receding"))
            assert found.number[j] == np.sum(kind == j)
            assert found.energy[j] == pytest.approx(drop[kind == j].sum())
            inside = (drop[kind == j] >= BIN_EDGES[20]) & (drop[kind == j] < BIN_EDGES[21])
            assert found.histogram[j, 20] == inside.sum()
        assert found.histogram.sum() == found.number.sum()
        assert found.truncated == 0


def test_spectra_leave_out_realisations_without_contact(tmp_path):
    plan = campaign(hurst=(0.8,), gamma=(0.04,), realisations=5)
    values = rows(plan)
    psd = np.array(values["psd_displacement"])
    psd[2, 1, 0] = np.nan
    values["psd_displacement"] = psd
    (cell,) = aggregate(write(tmp_path / "r.h5", plan, values)).cells
    assert cell.fields.in_contact.tolist() == [[5, 5, 5], [4, 5, 5]]
    expected = psd[[0, 1, 3, 4], 1, 0].astype(np.float32).mean(axis=0)
    np.testing.assert_allclose(cell.fields.psd_displacement[1, 0], expected, rtol=1e-6)
    slope, _ = fitted_slope(FieldPlan(plan), cell.fields.psd_displacement[0, 2])
    assert slope == pytest.approx(-2.8, abs=1e-3)
    with Results(tmp_path / "r.h5") as results:
        first = results.column("field_height", slice(0, 1))[0]
    np.testing.assert_array_equal(cell.fields.shape[0], first)


def test_a_fitted_slope_knows_its_error():
    plan = campaign(hurst=(0.8,), gamma=(0.04,), realisations=1)
    # The paper's spectrum: two decades, so that one of them is fitted.
    plan = parse_campaign(plan.text.replace("ratio = 10", "ratio = 100"))
    q = FieldPlan(plan).wave_number
    rng = np.random.default_rng(3)
    pulls = []
    for _ in range(300):
        density = q**-2.8 * np.exp(0.3 * rng.standard_normal(q.size))
        slope, error = fitted_slope(FieldPlan(plan), density)
        pulls.append((slope + 2.8) / error)
    assert abs(np.mean(pulls)) < 0.2
    assert 0.8 < np.std(pulls) < 1.5


@pytest.mark.parametrize(
    ("draw", "few", "least"),
    [
        (lambda rng, shape: rng.normal(1.0, 0.4, shape), 0.94, 0.94),
        (lambda rng, shape: rng.lognormal(-0.125, 0.5, shape), 0.90, 0.94),
        (lambda rng, shape: 1 + rng.standard_t(3, shape), 0.94, 0.94),
        (lambda rng, shape: rng.exponential(1.0, shape), 0.87, 0.93),
    ],
    ids=["normal", "skewed", "heavy tail", "exponential"],
)
def test_intervals_cover_the_true_mean_as_often_as_they_say(draw, few, least):
    """Coverage over 4000 synthetic ensembles of known mean 1; binomial error 0.0035."""
    rng = np.random.default_rng(11)
    for n, bound in ((5, few), (10, least), (30, least), (100, least)):
        low, high = interval(draw(rng, (4000, n)))
        covered = np.mean((low <= 1) & (high >= 1))
        assert bound <= covered <= 0.98, (n, covered)


def test_the_interval_reaches_as_far_as_students_and_as_halls():
    # Hall's cubic of the ends is Student's quantile again.
    skewness, n, t = np.array([-2.0, -0.3, 0.0, 1.0, 4.0]), 20, 0.468
    for x in (-t, t):
        w = untransformed(x, skewness, n)
        cubic = w + skewness * w**2 / 3 + skewness**2 * w**3 / 27 + skewness / (6 * n)
        np.testing.assert_allclose(cubic, x, atol=1e-6)
    values = np.random.default_rng(4).lognormal(0, 1, 20)
    std, mean = values.std(ddof=1), values.mean()
    student = 2.0930240544 * std / np.sqrt(20)  # t at 19 degrees of freedom
    low, high = interval(values)
    assert low == pytest.approx(mean - student)  # the short side
    assert high > mean + 1.2 * student  # the side of the tail
    other_low, other_high = interval(-3e-7 * values)
    assert (other_low, other_high) == (pytest.approx(-3e-7 * high), pytest.approx(-3e-7 * low))


def test_intervals_of_few_and_of_equal_values():
    assert [interval_method(n) for n in (0, 1, 2, 9, 10)] == [
        *("none", "none"),
        *("student", "student", "transformed"),
    ]
    low, high = interval(np.array([[1.0]]))
    assert np.isnan([low, high]).all()
    low, high = interval(np.full((1, 8), 2.5))
    assert (low, high) == (2.5, 2.5)
    (student,) = estimates(np.array([[1.0, 3.0]]))
    assert student.high == pytest.approx(2 + 12.7062047)  # t at one degree of freedom, sem = 1
    one, two = (interval(np.random.default_rng(0).random((2, 7))) for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_a_file_without_a_finished_task_is_refused(tmp_path):
    create(tmp_path / "empty.h5", campaign(realisations=2))
    with pytest.raises(InputError, match="no finished task"):
        aggregate(tmp_path / "empty.h5")


MEMORY = """
import sys
from adhesis.ensemble.aggregate import average as blocks
from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.run.launch import peak_bytes
blocks.HELD_AT_ONCE //= 20
blocks.READ_AT_ONCE //= 20
half, whole = sys.argv[1:]
aggregate(half)
before = peak_bytes()
data = aggregate(whole)
print(data.done, (peak_bytes() - before) / 2**20)
"""
COUNTED = ("loss_from_drops", "jump_count")


def test_memory_does_not_grow_with_the_curves(tmp_path):
    """Blocks a twentieth of their size; once a file is read, one twice as large takes no more."""
    text = text_of(hurst=(0.8,), gamma=(0.01, 0.04), realisations=1500, jumps=4)
    text = text.replace("unloading_until = -2.0", "unloading_until = -40.0")
    text = text.replace("field_nodes", "field_penetrations = []\nfield_nodes")
    paths = [tmp_path / "half.h5", tmp_path / "whole.h5"]
    for path, written in zip(paths, (text.replace("1500", "750"), text), strict=True):
        create(path, parse_campaign(written))
        with h5py.File(path, "r+") as data:
            done = data["status"].shape[0]
            for name in ("loss", "loss_dimensionless", "h_max", "m2", *COUNTED):
                data[name][:] = np.random.default_rng(1).random(done) + 1
            data["status"][:] = 1
        sign(path)
    half, whole = (path.stat().st_size / 2**20 for path in paths)
    out = run_python("-c", MEMORY, *paths).stdout.split()
    assert int(out[0]) == done
    assert whole - half > 35
    assert float(out[1]) < 9, f"{out[1]} MB for {whole - half:.0f} MB more"
