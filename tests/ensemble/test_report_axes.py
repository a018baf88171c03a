"""Averages, tables, curves and figures of a campaign on further axes than H and γ."""

import pickle
import re
from dataclasses import replace

import h5py
import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

import adhesis
from adhesis.ensemble.aggregate.average import aggregate
from adhesis.ensemble.aggregate.status import as_text, read_status
from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.campaign.tasks import Part
from adhesis.ensemble.report import findings, paper
from adhesis.ensemble.report.figures.catalogue import sections
from adhesis.ensemble.report.figures.style import style
from adhesis.ensemble.report.further_axes import shown_cells
from adhesis.ensemble.report.tables.campaign_tables import losses, works
from adhesis.ensemble.report.write_report import write_report
from adhesis.ensemble.results.layout import create
from adhesis.ensemble.results.schema import FAILED
from tests.support.campaign_support import table_of
from tests.support.figures import figures_of
from tests.support.synthetic_results import campaign, rows, sign, text_of, write

TOPS = (0.5, 0.7, 0.9)
AXES = {"ratio": [50, 100], "max_penetration": list(TOPS)}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    plan = campaign(hurst=(0.7, 0.8), gamma=(0.01, 0.04), realisations=3, **AXES)
    values = rows(plan)
    values["status"][-1] = 0  # the last cell lacks one
    return write(tmp_path_factory.mktemp("axes") / "r.h5", plan, values)


@pytest.fixture(scope="module")
def data(file):
    return aggregate(file)


def test_a_cell_is_one_point_on_all_axes(file, data):
    assert len(data.cells) == 2 * 2 * 2 * 3
    with xarray.open_dataset(file, engine="h5netcdf", phony_dims="sort") as raw:
        for cell in data.cells:
            mine = (raw.hurst == cell.hurst) & (raw.work_of_adhesion == cell.work_of_adhesion)
            for name, value in cell.others:
                mine &= raw[name] == value
            mine &= raw.status == 1
            np.testing.assert_array_equal(cell.values["loss"], raw.loss.values[mine.values])
    assert data.cells[-1].done == 2
    assert all(cell.done == 3 for cell in data.cells[:-1])


def test_curves_and_states_of_a_cell_are_in_its_own_units(data):
    for cell in data.cells:
        top = dict(cell.others)["max_penetration"]
        assert cell.penetration["loading"][-1] == pytest.approx(top)
        assert cell.penetration["unloading"][0] == pytest.approx(top)
        assert cell.plan.penetration[-1] == pytest.approx(top)


def test_figures_show_one_place_on_the_further_axes_that_has_results(file, data, tmp_path):
    assert {cell.others for cell in data.shown.cells} == {
        (("ratio", 100), ("max_penetration", 0.9))
    }
    assert [(c.hurst, c.work_of_adhesion) for c in data.shown.cells] == [
        (0.7, 0.01), (0.7, 0.04), (0.8, 0.01), (0.8, 0.04)
    ]  # fmt: skip
    assert set(data.shown.cells) < set(data.cells)
    values = rows(data.campaign)
    values["status"][values["max_penetration"] > 0.8] = 0
    early = aggregate(write(tmp_path / "r.h5", data.campaign, values))
    assert {c.others[1] for c in early.shown.cells} == {("max_penetration", 0.7)}
    # of few realisations a part has not every cell; those shown have the same further values
    create(tmp_path / "part.h5", data.campaign, part=Part(3, 7))
    with h5py.File(tmp_path / "part.h5", "r+") as part:
        part["status"][:] = 1
    found = aggregate(sign(tmp_path / "part.h5"))
    assert len(found.cells) < len(data.cells)
    assert {cell.others for cell in found.shown.cells} == {
        (("ratio", 100), ("max_penetration", 0.9))
    }


def test_figures_along_an_axis_are_said_where_there_are_some(data):
    assert "there are figures along ratio and max_penetration." in shown_cells(data)
    alone = replace(data, cells=data.shown.cells)
    assert shown_cells(alone).endswith("all cells are in the tables and in `curves.nc`.")


def test_the_papers_cells_alone_stand_beside_the_paper(data):
    found = {cell.others for cell in data.cells if paper.is_cell_of(cell)}
    assert found == {(("ratio", 100), ("max_penetration", 0.9))}


@pytest.mark.usefixtures("no_figures")
def test_tables_curves_and_page_have_every_axis(file, data, tmp_path, quick_figures):
    directory = tmp_path / "report"
    write_report(file, directory)
    for name in ("losses", "growth", "jumps", "slopes"):
        table = table_of(directory / f"{name}.csv")
        assert {(r["ratio"], r["max_penetration"]) for r in table} == {
            (str(ratio), str(top)) for ratio in (50, 100) for top in TOPS
        }, name
    with xarray.open_dataset(directory / "curves.nc") as curves:
        assert curves.sizes["ratio"] == 2
        for cell in data.cells:
            at = {"hurst": cell.hurst, "work_of_adhesion": cell.work_of_adhesion}
            mean = curves.loading_contact_fraction_mean.sel(**at, **dict(cell.others))
            np.testing.assert_array_equal(mean, cell.curves["loading_contact_fraction"].mean)
        assert "max_penetration" in curves.loading_penetration.attrs["long_name"]
    assert {"loss_along_ratio", "loss_along_max_penetration"} == set(quick_figures)
    page = (directory / "report.md").read_text(encoding="utf-8")
    assert "show the cells at ratio = 100, max_penetration = 0.9" in page
    assert "Along max_penetration from 0.5 to 0.9 the mean loss in J/m²" in page
    assert f"in steps of which {data.campaign.cycle.load_steps} lead to the largest and" in page


def test_figures_along_an_axis_hold_the_means_there(data):
    item = next(i for i in sections(data)["axes"] if i.name == "loss_along_max_penetration")
    with style():
        figure = item.draw(data)
    for axes in figure.axes:
        low, high = axes.get_ylim()
        for container in axes.containers:
            values = container.lines[0].get_ydata()
            assert low <= min(values) <= max(values) <= high
    # a panel for each (H, γ), a line for each ratio: the second one
    lines = [axes.containers[1].lines[0] for axes in figure.axes]
    places = [(h, g) for h in (0.7, 0.8) for g in (0.01, 0.04)]
    for line, name, unit, at in zip(
        lines,
        np.repeat(
            ["loss", "pull_off_stress", "pull_off_penetration",
             "largest_contact_fraction", "loss_per_contact"], 4
        ),
        np.repeat([1e-3, 1e3, 1, 1, 1e-3], 4),
        places * 5,
        strict=True,
    ):  # fmt: skip
        cells = [
            c
            for c in data.cells
            if (c.hurst, c.work_of_adhesion) == at and c.others[0] == ("ratio", 100)
        ]
        np.testing.assert_allclose(line.get_xdata(), TOPS, atol=0.01)
        mean = [c.estimates[name].mean / unit for c in cells]
        np.testing.assert_allclose(line.get_ydata(), mean)


def test_the_status_has_the_units_of_the_axes(tmp_path):
    load = 'control = "load"\nmax_stress = [100, 200]'
    text = campaign(hurst=(0.7,), gamma=(0.04,), realisations=2).text
    text = text.replace("young = 1e6", "young = [1e6, 2e6]").replace("max_penetration = 0.9", load)
    plan = parse_campaign(text.replace("unloading_until = -2.0\n", ""))
    create(tmp_path / "r.h5", plan)
    status = read_status(tmp_path / "r.h5")
    assert status["axis_units"]["max_stress"] == "Pa"
    heading = next(line for line in as_text(status).splitlines() if "γ in J/m²" in line)
    assert "young in Pa  max_stress in Pa  " in heading
    assert "loss in mJ/m² ± standard error of the mean" in heading
    many = as_text({**status, "groups": 61 * status["groups"][:1]})
    assert "61 cells are too many for a table here: --json lists them, and adhesis report" in many


def test_keys_that_vary_with_h_are_shown_at_every_h(tmp_path):
    text = text_of(hurst=(0.7, 0.8), gamma=(0.04,), realisations=2, ratio=[8, 10])
    text = text.replace("seed = 1", 'seed = 1\nzip = [["hurst", "ratio"]]')
    found = aggregate(write(tmp_path / "r.h5", text))
    assert [(c.hurst, *c.others) for c in found.shown.cells] == [
        (0.7, ("ratio", 8)), (0.8, ("ratio", 10))
    ]  # fmt: skip
    assert sections(found)["axes"] == []
    assert not found.paired


def test_a_second_scale_of_stress_needs_one_modulus(tmp_path):
    for zipped, scales in (("", 1), ('\nzip = [["hurst", "young"]]', 0)):
        text = text_of(realisations=2).replace("seed = 1", f"seed = 1{zipped}")
        text = text.replace("young = 1e6", "young = [1e6, 2e6]\nstrength = [1e6, 9e7, inf]")
        plot = adhesis.open(write(tmp_path / f"{scales}.h5", text)).plot
        (line, *_) = plot.loss_along("strength").axes[0].containers  # inf is said, not drawn
        np.testing.assert_allclose(line.lines[0].get_xdata(), [1e6, 9e7], rtol=0.2)
        (axes,) = plot.pull_off().axes
        found = [child for child in axes.child_axes if "sigma" in child.get_ylabel()]
        assert len(found) == scales


def test_opened_tables_and_figures_have_every_axis(file):
    results = adhesis.open(file)
    names = ["hurst", "work_of_adhesion", "ratio", "max_penetration"]
    assert results.losses.index.names == names
    assert results.mechanisms.index.names == [*names, "kind"]
    assert len(results.plot.loss_along("ratio").axes) == 4
    with pytest.raises(ValueError, match="there are ratio, max_penetration"):
        results.plot.loss_along("young")


def test_works_are_told_per_nominal_and_per_contact_area(data):
    table = works(data)
    names = [column.name for column in table.columns]
    for row, cell in zip(table.rows, data.cells, strict=True):
        reported = dict(zip(names, row, strict=True))
        gained, spent = cell.values["work_gained"], cell.values["work_spent"]
        contact = cell.values["largest_contact_fraction"]
        assert reported["work_gained_mean [J/m^2]"] == gained.mean()
        separation = reported["effective_work_of_separation_mean [J/m^2]"]
        assert separation == pytest.approx((spent / contact).mean())
        approach = reported["effective_work_of_approach_mean [J/m^2]"]
        assert approach == pytest.approx((gained / contact).mean())
        low = reported["loss_per_contact_ci_low [J/m^2]"]
        assert low <= (cell.values["loss"] / contact).mean()


def test_units_are_those_in_which_the_campaign_was_written(tmp_path):
    """0.5 µm is shown so, and not as 500 nm; in figures, tables and names of cells."""
    text = campaign(hurst=(0.8,), gamma=(0.01, 0.02), realisations=3).text
    text = text.replace("[0.01, 0.02]", '["10 mJ/m2", "20 mJ/m2"]')
    plan = parse_campaign(re.sub(r"h_rms = .*", 'h_rms = ["0.5 um", "1 um"]', text))
    assert pickle.loads(pickle.dumps(plan)) == plan
    assert plan.tasks()[0].cell_name == "H = 0.8, γ = 10 mJ/m², h_rms = 0.5 µm"
    path = write(tmp_path / "r.h5", plan)
    plot = adhesis.open(path).plot
    figure = plot.loss_along("h_rms")
    assert figure.axes[-1].get_xlabel().endswith("(µm)")
    assert figure.axes[-1].get_xticks().tolist() == [0.5, 1.0]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        r"$\gamma$ = 10 mJ/m²",
        r"$\gamma$ = 20 mJ/m²",
    ]
    assert plot.pull_off().axes[0].get_xlabel() == r"work of adhesion $\gamma$ (mJ/m²)"
    assert plot.pull_off().get_supxlabel() == "h_rms = 1 µm"
    heading, _, first, *_ = losses(aggregate(path)).markdown().splitlines()
    assert [cell.strip() for cell in heading.split("|")[2:4]] == ["γ (mJ/m²)", "h_rms (µm)"]
    assert [cell.strip() for cell in first.split("|")[2:4]] == ["10", "0.5"]


def test_spectra_are_of_cells_that_have_fields(tmp_path):
    """A loop short of its preload has no state at a part of it: its panel would be empty."""
    plan = campaign(hurst=(0.8,), gamma=(0.01, 0.04), realisations=2)
    values = rows(plan)
    values["psd_displacement"][2:] = 0  # none of the second work of adhesion
    plot = adhesis.open(write(tmp_path / "r.h5", plan, values)).plot
    (panel,) = plot.spectra_of_branches().axes
    assert "0.01 J/m²" in panel.get_title(loc="left")


@pytest.fixture(scope="module")
def with_failures(tmp_path_factory):
    """Of 3 loops each, one failed at h_rms = 0.5 µm, all at 1 µm where the ratio is 50."""
    text = campaign(hurst=(0.8,), gamma=(0.04,), realisations=3, ratio=[50, 100]).text
    plan = parse_campaign(re.sub(r"h_rms = .*", 'h_rms = ["0.5 um", "1 um"]', text))
    values = rows(plan)
    ratio, height = (
        np.array([dict(t.others)[n] for t in plan.tasks()]) for n in ("ratio", "h_rms")
    )
    values["status"][np.flatnonzero((ratio == 50) & (height == 0.5e-6))[0]] = FAILED
    values["status"][(ratio == 50) & (height == 1e-6)] = FAILED
    return write(tmp_path_factory.mktemp("failures") / "r.h5", plan, values)


def test_a_mean_without_the_loops_that_failed_is_hollow(with_failures):
    """What is left is what could be computed, which may be another kind of loops."""
    figure = adhesis.open(with_failures).plot.loss_along("h_rms")
    marks = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == "white"]
    assert [x for line in marks for x in line.get_xdata()] == pytest.approx([0.5], abs=0.01)
    assert figure.legends[0].get_texts()[-1].get_text() == "loops failed"
    assert " ".join(figure.get_supxlabel().split()) == (
        r"missing, as all tasks failed: H = 0.8, $\gamma$ = 0.04 J/m², ratio = 50, "
        "h_rms = 1 µm 1 of 9 loops failed, and are in no mean "
        "n = 2 to 3 profiles, 95 % interval of the mean"
    )
    data = aggregate(with_failures)
    assert any(text.endswith("First reason: no reason given.") for text in findings.missing(data))
    item = sections(data)["axes"][0]
    assert "(paired)" in item.caption
    assert "Hollow: means without loops that failed" in item.caption
    assert "line" not in item.caption.lower()  # two points are not joined


def test_a_listed_row_is_named_by_all_its_axes(with_failures):
    status = read_status(with_failures)
    listed = [line.strip() for line in as_text(status).splitlines() if line.startswith("  row ")]
    names = [failure["task"] for failure in status["failures"]]
    assert len(set(names)) == len(names) == 4
    assert "ratio = 50, h_rms = 1 µm, realisation" in names[-1]
    assert all(name in line for name, line in zip(names, listed[-4:], strict=True))


def test_a_note_belongs_to_the_cells_that_are_drawn(with_failures):
    names = "fig7_loop_against_penetration", "loss_by_mechanism", "jump_energies"
    *drawn, along = figures_of(aggregate(with_failures), *names, "loss_along_ratio")
    assert {figure.get_supxlabel() for figure in drawn} == {"ratio = 100, h_rms = 1 µm"}
    assert "failed" in along.get_supxlabel()


def test_a_loss_under_a_weight_says_so_at_its_axis(tmp_path):
    text = text_of(hurst=(0.8,), realisations=2).replace("unloading_until = -2.0\n", "")
    text = text.replace("max_penetration = 0.9", 'control = "load"\nmax_stress = [100, 200]')
    plot = adhesis.open(write(tmp_path / "r.h5", text)).plot
    labels = [axes.get_ylabel() for axes in plot.loss_along("max_stress").axes]
    assert [label for label in labels if "mJ" in label] == [
        "loss\nunder a weight (mJ/m²)",
        "loss per contact\nunder a weight (mJ/m²)",
    ]
    assert "under a weight" in plot.loss_against_hurst().axes[0].get_ylabel()


def test_given_axes_have_the_note_the_caps_and_room_for_the_legend(with_failures):
    results = adhesis.open(with_failures)
    figure = Figure(layout="constrained")
    axes = figure.subplots()
    assert results.plot.loss_along("h_rms", ax=axes) is figure
    (note,) = axes.texts
    assert "1 of 9 loops failed, and are in no mean" in note.get_text().splitlines()
    figure.draw_without_rendering()
    assert note.get_window_extent().y0 >= 0
    assert note.get_window_extent().y1 < axes.xaxis.label.get_window_extent().y0
    legend = axes.get_legend().get_window_extent()
    for container in axes.containers:
        _, caps, (bars,) = container.lines
        assert caps
        highest = max(end[1] for ends in bars.get_segments() for end in ends)
        assert axes.transData.transform((0, highest))[1] < legend.y0


def test_a_note_that_is_cut_off_is_a_warning(with_failures):
    axes = Figure().subplots()  # leaves no room below the label of the axis
    plot = adhesis.open(with_failures).plot
    about = r"below the axes: .*1 of 9 loops failed, and are in no"
    with pytest.warns(UserWarning, match=about) as caught:
        plot.loss_along("h_rms", ax=axes)
    with pytest.warns(UserWarning, match="ratio = 100") as more:
        plot.loss_against_hurst(ax=Figure(figsize=(3, 2)).subplots())
    assert {warning.filename for warning in (*caught, *more)} == {__file__}


def test_a_notebook_tells_small_values_of_an_axis_apart(tmp_path):
    text = text_of(hurst=(0.8,), gamma=(0.04,), realisations=2)
    text = re.sub(r"h_rms = .*", 'h_rms = ["1 um", "1.4 um"]', text)
    results = adhesis.open(write(tmp_path / "r.h5", text))
    page = results._repr_html_()
    assert ">1e-06</th>" in page
    assert ">1.4e-06</th>" in page
    assert "<th>warning</th><td>4 of 4 losses are doubtful, as their audit residual" in page
    assert results.losses.index.get_level_values("h_rms").tolist() == [1e-6, 1.4e-6]
