"""A results file opened in Python: labelled axes, tables, figures; the report's numbers."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure

import adhesis
from adhesis.ensemble.campaign.tasks import Part
from adhesis.ensemble.report.figures.catalogue import ALL
from adhesis.ensemble.report.tables.campaign_tables import losses
from adhesis.ensemble.results.layout import create
from tests.support.synthetic_results import campaign, rows, sign, write


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    plan = campaign(hurst=(0.7, 0.8), gamma=(0.01, 0.04, 0.07), realisations=4)
    values = rows(plan)
    values["status"][[2, 9]] = [0, 2]
    for name in ("loss", "loading_mean_stress"):
        values[name][[2, 9]] = np.nan
    return write(tmp_path_factory.mktemp("opened") / "r.h5", plan, values)


@pytest.fixture(scope="module")
def results(file):
    return adhesis.open(file)


def test_every_loop_is_found_under_its_labels(file, results):
    data = results.dataset
    assert data.loss.dims == ("hurst", "work_of_adhesion", "realisation")
    assert data.loading_mean_stress.dims[3:] == ("loading_penetration",)
    assert data.loss.attrs["units"] == "J m-2"
    with h5py.File(file) as raw:
        for row in (0, 5, 17, 23):
            label = {name: raw[name][row] for name in ("hurst", "work_of_adhesion", "realisation")}
            assert float(data.loss.sel(label)) == raw["loss"][row]
            np.testing.assert_array_equal(
                data.unloading_energy.sel(label), raw["unloading_energy"][row]
            )
        assert repr(adhesis.open(file)) == repr(results)  # also while this process has it open
    assert int(np.isnan(data.loss).sum()) == 2
    assert repr(results).endswith("22 done, 1 failed, 1 pending>")


def test_a_part_has_the_labels_of_its_own_rows(tmp_path):
    plan, part = campaign(hurst=(0.7, 0.8), gamma=(0.01,), realisations=4), Part(2, 3)
    path = tmp_path / "part.h5"
    create(path, plan, part=part)
    with h5py.File(path, "r+") as raw:
        raw["loss"][:] = 10.0 * raw["hurst"][:] + raw["realisation"][:]
        raw["status"][:] = 1
        labels = set(zip(raw["hurst"][:].tolist(), raw["realisation"][:].tolist(), strict=True))
    data = adhesis.open(sign(path)).dataset
    known = data.loss.squeeze().to_series().dropna()
    assert set(known.index) == labels
    assert all(loss == 10.0 * hurst + number for (hurst, number), loss in known.items())


def test_tables_are_those_of_the_report(results):
    table = losses(results.averages)
    frame = results.losses
    assert list(frame.index.names) == ["hurst", "work_of_adhesion"]
    for row in table.rows:
        assert frame.loc[row[:2], "loss_dimensionless_mean"] == row[5]
    low, high = (frame[f"loss_dimensionless_ci_{end}"] for end in ("low", "high"))
    assert ((low < frame.loss_dimensionless_mean) & (frame.loss_dimensionless_mean < high)).all()
    assert len(results.growth) == 4
    shares = results.mechanisms.groupby(["hurst", "work_of_adhesion"]).share_of_drops.sum()
    np.testing.assert_allclose(shares, 1)


def test_the_catalogue_has_every_jump_of_the_finished_loops(file, results):
    jumps = results.jumps
    with h5py.File(file) as raw:
        done = raw["status"][:] == 1
        drops = raw["jump_energy_drop"][:][done]
        assert len(jumps) == raw["jump_count"][:][done].sum()
    assert jumps.energy_drop.sum() == pytest.approx(np.nansum(drops))
    assert set(jumps.branch) == {"loading", "unloading"}
    assert "pull-off" in set(jumps.kind)
    assert not (
        (jumps.hurst == 0.7) & (jumps.realisation == 2) & (jumps.work_of_adhesion == 0.01)
    ).any()


def test_fields_have_branch_penetration_and_position(file, results):
    fields = results.fields
    assert fields.field_gap.dims[3:] == ("branch", "penetration", "position")
    one = fields.field_displacement.sel(hurst=0.8, work_of_adhesion=0.04, realisation=0)
    with h5py.File(file) as raw:
        place = raw["field_task"][:].tolist().index(16)
        np.testing.assert_array_equal(
            one.sel(branch="unloading"), raw["field_displacement"][place, 1]
        )
    assert results.spectra.gap_density.dims[3:] == ("branch", "penetration", "gap_bin")
    assert results.curves.loading_mean_stress_mean.attrs["units"] == "Pa"


def test_every_figure_of_the_report_has_a_method_that_returns_it(results):
    assert {item.draw.__name__ for item in ALL} | {"loss_along"} == set(dir(results.plot))
    for name in ("loop_against_penetration", "height_density"):
        figure = getattr(results.plot, name)()
        assert figure._repr_png_().startswith(b"\x89PNG")  # what a notebook displays
        assert figure.axes[0].lines
    assert results.plot.loss_against_hurst().axes[-1].get_xlabel() == "Hurst exponent $H$"


def test_every_figure_is_drawn_into_axes_that_are_given(tmp_path, monkeypatch):
    """A figure of a user's own has the curves, scales and labels of the one of the report.

    What its layout is asked for: test_report_axes.py.
    """
    monkeypatch.setattr(Figure, "draw_without_rendering", lambda figure: None)
    results = adhesis.open(write(tmp_path / "r.h5", campaign(hurst=(0.8,), realisations=4)))
    names = [name for name in dir(results.plot) if name != "loss_along"]
    for name in names:
        draw = getattr(results.plot, name)
        alone = draw()
        mine = Figure(figsize=(6, 20))
        given = mine.subplots(len(alone.axes), 1, squeeze=False)
        assert draw(ax=given) is mine
        for panel, own in zip(given[:, 0], alone.axes, strict=True):
            assert len(panel.collections) == len(own.collections), name
            assert panel.get_xscale() == own.get_xscale(), name
            assert panel.get_yscale() == own.get_yscale(), name
            assert panel.get_xlabel(), name
        assert given[0, 0].get_legend() is not None, name


def test_one_axes_takes_the_first_panel_and_wrong_ones_are_refused(results):
    draw = results.plot.loss_against_hurst
    alone, first = draw(), Figure(layout="constrained").subplots()
    draw(ax=first)
    assert len(first.collections) == len(alone.axes[0].collections)
    assert first.get_xlabel()
    with pytest.raises(ValueError, match=rf"ax holds {len(alone.axes) + 1} Axes: this figure"):
        draw(ax=Figure().subplots(1, len(alone.axes) + 1))
    with pytest.raises(TypeError, match="ax is 3: it must be one Axes of matplotlib"):
        draw(ax=3)
