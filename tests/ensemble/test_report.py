"""The report: what the tables say, what the figures draw, what the page shows."""

import base64
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import matplotlib as mpl
import numpy as np
import pytest
import xarray
from matplotlib.container import BarContainer, ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.markers import CARETDOWN

from adhesis.ensemble.aggregate.average import BIN_EDGES, BINS_PER_DECADE, aggregate
from adhesis.ensemble.aggregate.cells import differing_keys, kind_of
from adhesis.ensemble.aggregate.status import as_text, read_status
from adhesis.ensemble.campaign.file import load_campaign, parse_campaign
from adhesis.ensemble.campaign.tables import Campaign
from adhesis.ensemble.command.main import main
from adhesis.ensemble.report import findings, paper
from adhesis.ensemble.report.figures import catalogue, loops, loss_figures, shapes_and_spectra
from adhesis.ensemble.report.figures.style import save, style
from adhesis.ensemble.report.html import html_page
from adhesis.ensemble.report.markdown_page import write_page
from adhesis.ensemble.report.tables import campaign_tables
from adhesis.ensemble.report.write_report import write_report
from adhesis.ensemble.task.compute import make_problem
from adhesis.ensemble.task.fields import GAP_BINS
from tests.support.browser import needs_browser, seen_by_browser
from tests.support.campaign_support import ROOT, table_of
from tests.support.figures import few_figures, figures_of
from tests.support.synthetic_results import campaign, rows, text_of, write

GAMMAS = (0.01, 0.04, 0.07)
PLAN = {"hurst": (0.7, 0.8), "gamma": GAMMAS, "realisations": 5, "ratio": 100}


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    return write(tmp_path_factory.mktemp("report") / "r.h5", text_of(**PLAN))


@pytest.fixture(scope="module")
def data(file):
    return aggregate(file)


# The figure that is laid out and written, which takes seconds: all are by one function.
SAVED = "loss_by_mechanism"


@pytest.fixture(scope="module")
def drawn(file) -> dict[str, Figure]:
    """The figures of the report by name."""
    with few_figures(SAVED) as figures:
        write_report(file, file.parent / "report")
    return figures


@pytest.fixture(scope="module")
def report(drawn, file) -> Path:
    return file.parent / "report"


def lines_of(axes) -> dict[str, np.ndarray]:
    return {line.get_label(): line.get_xydata() for line in axes.lines}


def test_losses_csv_holds_the_averages_with_units(report, data):
    table = table_of(report / "losses.csv")
    assert [(float(r["hurst"]), float(r["work_of_adhesion [J/m^2]"])) for r in table] == [
        (h, g) for h in (0.7, 0.8) for g in GAMMAS
    ]
    for row, cell in zip(table, data.cells, strict=True):
        loss = cell.values["loss"]
        assert float(row["loss_mean [J/m^2]"]) == loss.mean()
        assert float(row["loss_over_work_of_adhesion"]) == loss.mean() / cell.work_of_adhesion
        assert float(row["loss_sem [J/m^2]"]) == pytest.approx(loss.std(ddof=1) / np.sqrt(5))
        assert float(row["loss_dimensionless_ci_low"]) < float(row["loss_dimensionless_mean"])
        assert float(row["audit_residual_largest"]) == np.abs(cell.values["audit_residual"]).max()
        assert float(row["m2_mean"]) == pytest.approx(cell.values["m2"][0])
        tension = 2 * cell.values["pull_off_stress"] / (1e6 / 0.75 * 1000 * cell.values["h_max"])
        assert float(row["pull_off_stress_dimensionless_mean"]) == pytest.approx(tension.mean())
        value = paper.TABLE_1.get((cell.hurst, cell.work_of_adhesion))
        assert row["loss_dimensionless_paper"] == ("" if value is None else str(value))
        assert float(row["loss_dimensionless_error_numerical"]) == pytest.approx(
            1e-4 * cell.values["loss_dimensionless"].mean()
        )


def test_the_papers_table_has_eight_numbers_and_a_dash():
    table = [[paper.TABLE_1.get((h, g)) for g in GAMMAS] for h in (0.7, 0.8, 0.9)]
    assert table == [[None, 26.6, 42.83], [3.44, 19.36, 49.25], [2.59, 17.91, 28.15]]
    assert len(paper.TABLE_1) == 8
    assert (paper.m2(0.7), paper.m2(0.9), paper.m2(0.5)) == (5.1e-3, 1.5e-3, None)


def of_paper(of: Campaign) -> bool:
    return paper.is_reading(of, of.sweep.hurst)


def test_the_paper_stands_beside_its_own_campaigns_alone(tmp_path):
    for name in ("paper", "beside/ratio-200", "beside/equal-c0", "beside/penetration-0.93"):
        assert of_paper(load_campaign(ROOT / "jobs" / f"{name}.toml")), name
    text = (ROOT / "jobs" / "paper.toml").read_text()
    text = re.sub(r"field_penetrations = .*", "", text)  # none at a preload
    assert of_paper(parse_campaign(text))
    for old, new in (
        ("max_penetration = 0.9 ", "max_penetration = 0.98 "),
        ("ratio = 100", "ratio = 10"),
        ("young = 1e6", "young = 2e6"),
        ("poisson = 0.5", "poisson = 0.3"),
        ("poisson = 0.5", "poisson = 0.5\nwork_of_adhesion_open = 1"),
        ("poisson = 0.5", "poisson = 0.5\nstrength = 1e6"),
        ("poisson = 0.5", "poisson = 0.5\nadhesion_range = 1e-9"),
        ("max_penetration = 0.9 ", "preload = 500\nmax_penetration = 0.9 "),
        ("n0 = 10", "n0 = 9"),
        ("h_rms = 1e-6", "h_rms = 2e-6"),
    ):
        assert old in text
        assert not of_paper(parse_campaign(text.replace(old, new))), new
    plan = campaign(hurst=(0.8,), gamma=(0.04,), realisations=3, ratio=20)
    data = aggregate(write(tmp_path / "r.h5", plan))
    page = write_page(data, catalogue.sections(data))
    assert "19.36" not in page
    assert "aper" not in page.replace("paper.h5", "")
    campaign_tables.losses(data).write_csv(tmp_path / "losses.csv")
    assert "19.36" not in (tmp_path / "losses.csv").read_text()
    with style():
        assert "paper" not in lines_of(loss_figures.loss_against_hurst(data).axes[0])


def test_tables_print_as_plain_lines(data):
    """On a terminal, too: a table that is fitted into its width has its numbers cut."""
    lines = str(campaign_tables.losses(data)).splitlines()
    assert len(lines) == 2 + 6
    assert lines[6].split()[:3] == ["0.8", "0.04", "5"]
    assert "19.36" in lines[6]
    assert "failed" not in lines[1]  # nothing has


def test_jumps_by_kind_add_up_to_all_drops(data):
    """Those of all jumps: test_opened.py."""
    glance = campaign_tables.shares_by_kind(data)
    place = {row[:3]: row[-1] for row in campaign_tables.jumps(data).rows}
    for row in glance.rows:
        assert sum(row[2:]) == pytest.approx(1)
        for column, share in zip(glance.columns[2:], row[2:], strict=True):
            assert share == pytest.approx(place.get((*row[:2], column.name), 0))


def test_curves_open_in_xarray_with_units(report, data):
    with xarray.open_dataset(report / "curves.nc") as curves:
        assert curves.sizes["hurst"] == 2
        for name, array in curves.variables.items():
            assert array.attrs["units"], name
            assert array.attrs["long_name"], name
        assert curves["loading_mean_stress_mean"].attrs["units"] == "Pa"
        one = curves["unloading_mean_stress_dimensionless_mean"]
        one = one.sel(hurst=0.8, work_of_adhesion=0.07)
        (cell,) = data.finished([0.8], [0.07])
        mean = cell.curves["unloading_mean_stress_dimensionless"].mean
        np.testing.assert_array_equal(one, mean)
        assert curves["realisations"].values.tolist() == [[5] * 3] * 2
        quantiles = curves["loading_contact_fraction_quantiles"]
        assert (quantiles.diff("quantile") >= 0).all()


def test_contact_is_drawn_against_stress_over_slope(data, drawn):
    figure = drawn["fig6_contact_against_stress"]
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["H = 0.7", "H = 0.8"]
    lines = lines_of(figure.axes[1])
    assert len(lines) == 6
    cell = data.finished([0.8], [0.04])[0]
    line = lines[r"$\gamma$ = 0.04 J/m², unloading"]
    for place, name in enumerate(("mean_stress_over_slope", "contact_fraction")):
        np.testing.assert_array_equal(line[:, place], cell.curves[f"unloading_{name}"].mean)


def test_an_interval_that_goes_on_below_zero_is_marked():
    figure = Figure()
    axes = figure.subplots()
    found = [SimpleNamespace(mean=1.0, low=low, high=2.0) for low in (-0.5, 0.5)]
    cells = [SimpleNamespace(estimates={"loss": e}, failed=0, short_of_preload=0) for e in found]
    what = (axes, np.array([1.0, 2.0]), cells, "loss", 1.0, 0, "loss")
    loss_figures.errorbar(*what)
    (mark,) = [line for line in axes.lines if line.get_marker() == CARETDOWN]
    assert mark.get_xydata().tolist() == [[1.0, 0.0]]
    axes.cla()
    loss_figures.errorbar(*what, from_zero=False)
    assert CARETDOWN not in [line.get_marker() for line in axes.lines]


def test_loops_are_drawn_with_one_standard_deviation(data, drawn):
    figure = drawn["fig7_loop_against_penetration"]
    assert len(figure.axes) == 4
    for column in (figure.axes[::2], figure.axes[1::2]):  # one scale for all H
        assert len({axes.get_ylim() for axes in column}) == 1
    axes = figure.axes[2]
    cell = data.finished([0.8], [0.01])[0]
    line = lines_of(axes)[r"$\gamma$ = 0.01 J/m², loading"]
    np.testing.assert_array_equal(line[:, 0], data.campaign.penetration["loading"])
    np.testing.assert_array_equal(line[:, 1], cell.curves["loading_mean_stress_dimensionless"].mean)
    band = axes.patches[0].get_path().vertices
    half = cell.curves["loading_mean_stress_dimensionless"].std[-1]
    top = band[band[:, 0] == data.campaign.penetration["loading"][-1], 1]
    assert np.ptp(top) == pytest.approx(2 * half)
    assert axes.get_xlabel().startswith("penetration")
    assert "sigma" in axes.get_ylabel()


def test_losses_are_drawn_with_their_intervals_and_the_paper_beside(data, drawn):
    """A panel for each γ; few points are not joined by a line."""
    figure = drawn["table1_losses"]
    for axes, gamma in zip(figure.axes, GAMMAS, strict=True):
        assert f"= {gamma:g} J" in axes.get_title(loc="left")
        found = [data.finished([h], [gamma])[0].estimates["loss_dimensionless"] for h in (0.7, 0.8)]
        (container,) = axes.containers
        line, _, (bars,) = container.lines
        np.testing.assert_array_equal(line.get_xdata(), [0.7, 0.8])
        np.testing.assert_allclose(line.get_ydata(), [e.mean for e in found])
        assert line.get_linestyle() == "None"
        ends = np.array(bars.get_segments())[:, :, 1]
        np.testing.assert_allclose(ends, [[e.low, e.high] for e in found], rtol=1e-12)
        stars = [line.get_xydata()[0] for line in axes.lines if line.get_label() == "paper"]
        quoted = [(h, paper.TABLE_1.get((h, gamma))) for h in (0.7, 0.8)]
        assert [y for _, y in stars] == [value for _, value in quoted if value is not None]
        for (x, _), (hurst, _) in zip(stars, quoted[-len(stars) :], strict=True):
            assert hurst < x < hurst + 0.05
    assert "H" in figure.axes[0].get_xlabel()


def test_bars_stack_both_mechanisms_to_the_sum_of_the_drops(data, drawn):
    axes = drawn["loss_by_mechanism"].axes[0]
    large, small = (c for c in axes.containers if isinstance(c, BarContainer))
    for k, cell in enumerate(data.cells):
        top = small[k].get_y() + small[k].get_height()
        assert top == pytest.approx(1e3 * cell.values["loss_from_drops"].mean())
        assert large[k].get_height() == pytest.approx(1e3 * cell.values["loss_large_scale"].mean())
    spread = [c for c in axes.containers if isinstance(c, ErrorbarContainer)]
    for bars, name in zip(spread, ("loss_large_scale", "loss_small_scale"), strict=True):
        ends = np.array(bars.lines[2][0].get_segments())[:, :, 1]
        found = [cell.estimates[name] for cell in data.cells]
        np.testing.assert_allclose(np.ptp(ends, axis=1), [1e3 * (e.high - e.low) for e in found])


def test_jump_densities_integrate_to_the_number_of_jumps(data, drawn):
    cell = data.finished([0.7], [0.01])[0]
    total = 0.0
    for axes in drawn["jump_energies"].axes[:2]:
        label = r"$\gamma$ = 0.01 J/m²"
        patch = next(p for p in axes.patches if p.get_label() == label)
        values, edges, _ = patch.get_data()
        total += np.nansum(values * np.diff(np.log10(edges)))
        assert BIN_EDGES[0] <= edges[0] < edges[-1] <= BIN_EDGES[-1]
    assert total == pytest.approx(cell.values["jump_count"].mean())
    assert BINS_PER_DECADE * np.log10(edges[1] / edges[0]) == pytest.approx(1)


def test_figures_of_fields_are_at_the_papers_values_or_say_at_which_they_are(tmp_path):
    """The paper's captions: Fig. 3 γ = 0.01, Fig. 4 Δ~ = 0.4, Fig. 8 H = 0.7 and Δ~ = 0.7."""
    for kept, drawn_at, said in (
        ((0.3, 0.4, 0.7, 0.9), 9 * 0.045, ("", "")),  # the nearest of 20 load steps
        ((0.36, 0.54, 0.9), 0.36, ("Δ/h_max = 0.36", "Δ/h_max = 0.54")),
    ):
        listed = f"field_nodes = 256\nfield_penetrations = {list(kept)}"
        text = text_of(**PLAN | {"realisations": 2}).replace("field_nodes = 256", listed)
        data = aggregate(write(tmp_path / f"{len(kept)}.h5", text))
        page = write_page(data, catalogue.sections(data))
        shapes, both = figures_of(data, "fig3_shapes", "fig4_spectra_of_branches")
        caption = dict(re.findall(r"\*\*.*\(paper's (.*)\)\.\*\* (.*) \(\[PDF", page))
        assert "H = 0.8, $\\gamma$ = 0.01 J/m²" in shapes.axes[0].get_title(loc="left")
        assert "is at H = 0.8, γ = 0.01 J/m². Its separations" in caption["Fig. 3"]
        for axes, gamma in zip(both.axes, (0.01, 0.04), strict=True):
            title = axes.get_title(loc="left")
            assert f"H = 0.8, $\\gamma$ = {gamma} J/m²" in title
            assert title.endswith(f"= {drawn_at:.2f}")
            branches = lines_of(axes)
            cell = data.finished([0.8], [gamma])[0]
            state = int(np.argmin(np.abs(cell.plan.penetration - drawn_at)))
            for b, branch in enumerate(("loading", "unloading")):
                spectrum = cell.fields.psd_displacement[b, state]
                np.testing.assert_array_equal(branches[branch][:, 1], spectrum)
        places = {"Fig. 4": "H = 0.8, γ = 0.01 and 0.04 J/m²", "Fig. 8": "H = 0.7, γ = 0.04 J/m²"}
        for (name, place), nearest, at in zip(places.items(), said, (0.4, 0.7), strict=True):
            end = f"; the nearest to it here is {place}, {nearest}." if nearest else "."
            assert caption[name].endswith(f"is at {place}, Δ/h_max = {at:g}{end}")
        for name in ("Fig. 5(a)", "Fig. 5(b)"):
            assert caption[name].endswith("figure is at H = 0.8, γ = 0.04 J/m².")


def test_a_campaign_without_the_papers_values_draws_what_it_has(tmp_path):
    plan = campaign(hurst=(0.5, 0.6), gamma=(0.02, 0.05), realisations=2)
    data = aggregate(write(tmp_path / "r.h5", plan))
    cells = shapes_and_spectra.nearest(data.cells, paper.FIGURE_4)
    assert [(c.hurst, c.work_of_adhesion) for c in cells] == [(0.6, 0.02), (0.6, 0.05)]
    said = shapes_and_spectra.beside_paper(data, paper.FIGURE_3)
    assert said.endswith("; the nearest to it here is H = 0.6, γ = 0.02 J/m².")


def test_shapes_show_the_surface_above_the_profile(data, drawn):
    """In the frame of the profile, so that branches of different separation can be compared."""
    figure = drawn["fig3_shapes"]
    assert len(figure.axes) == 6
    cell = data.finished([0.8], [0.01])[0]
    height, surface = cell.fields.shape
    lines = lines_of(figure.axes[0])
    assert len(lines["rigid"]) == 4 * 255 + 1  # 256 nodes would be seen as a polygon
    nodes = lines["rigid"][::4, 1], lines["unloading"][::4, 1]
    np.testing.assert_allclose(nodes[0], 1e6 * height, atol=1e-9)
    above = surface[1, -1] - height
    np.testing.assert_allclose(nodes[1] - nodes[0], 1e6 * (above - above.min()), atol=1e-9)
    assert (nodes[1] - nodes[0]).min() == pytest.approx(0, abs=1e-9)  # they touch
    detail = lines_of(figure.axes[1])["rigid"]
    assert detail[:, 1].max() == pytest.approx(lines["rigid"][:, 1].max())
    assert len(detail) < len(lines["rigid"]) / 3


def test_every_gamma_is_drawn_or_said_to_be_left_out(tmp_path):
    for count, said in ((5, ""), (8, "6 of 8 γ")):
        plan = campaign(hurst=(0.7,), gamma=tuple(0.01 * k for k in range(1, count + 1)))
        data = aggregate(write(tmp_path / f"{count}.h5", plan))
        (figure,) = figures_of(data, "fig7_loop_against_penetration")
        drawn = lines_of(figure.axes[0])
        assert len([k for k in drawn if "unloading" in k]) == min(count, 6)
        page = write_page(data, catalogue.sections(data))
        assert ("Figures with a panel" in page) is bool(said)
        assert said in page


def test_spectra_carry_both_reference_slopes(data, drawn):
    lines = lines_of(drawn["fig5a_spectra_loading"].axes[1])
    for label, slope in (("slope -2.6", -2.6), ("slope -2.8", -2.8), ("rigid", -2.6)):
        x, y = np.log(lines[label]).T
        assert (y[-1] - y[0]) / (x[-1] - x[0]) == pytest.approx(slope, abs=1e-5)
    x, y = np.log(lines["0.90"]).T
    assert (y[-1] - y[0]) / (x[-1] - x[0]) == pytest.approx(-2.8, abs=1e-3)
    rows_of = {(r[0], r[1], r[2], round(r[3], 2)): r[5] for r in campaign_tables.slopes(data).rows}
    assert rows_of[0.7, 0.01, "unloading", 0.9] == pytest.approx(-2.7, abs=1e-3)


def test_densities_are_drawn_as_they_are(drawn):
    heights = lines_of(drawn["fig9_height_density"].axes[0])
    loading, unloading, *_ = map(lines_of, drawn["fig8_gap_density"].axes)
    near_zero = heights["H = 0.8"][np.abs(heights["H = 0.8"][:, 0]).argmin()]
    assert near_zero[1] == pytest.approx(heights["Gaussian"][:, 1].max(), rel=0.02)
    assert len(loading) == len(unloading) == 3
    for gaps in (loading["0.90"], unloading["0.90"]):
        np.testing.assert_allclose(gaps[:, 1], 0.7 * np.exp(-gaps[:, 0]), rtol=1e-4)
        # The outermost bins hold all smaller and larger gaps, too.
        np.testing.assert_array_equal(gaps[:, 0], GAP_BINS[1:-1])


def test_every_figure_is_legible_at_column_width_in_colour_and_grey(drawn, monkeypatch, tmp_path):
    monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)  # laid out, but not drawn
    for name, figure in drawn.items():
        save(figure, tmp_path / name)
        width, height = figure.get_size_inches()
        assert any(25.4 * width == pytest.approx(millimetres) for millimetres in (85, 175))
        texts = [t for t in figure.findobj(mpl.text.Text) if t.get_text() and t.get_visible()]
        assert min(t.get_fontsize() for t in texts) >= 4.5, name  # indices in formulas
        with style():
            box = figure.get_tightbbox()
        assert min(box.x0, box.y0, width - box.x1, height - box.y1) >= 0, name  # nothing is cut off
        bottom = figure.axes[-1] if name != "pull_off_stress" else figure.axes[0]
        assert bottom.get_xlabel(), name
        assert figure.axes[0].get_ylabel(), name
        for axes in figure.axes:
            solid = {}
            for line in axes.lines:
                if line.get_label().startswith("_") or not line.get_xydata().size:
                    continue
                looks = (line.get_color(), str(line.get_linestyle()), str(line.get_marker()))
                assert solid.setdefault(looks, line.get_label()) == line.get_label(), name


def test_the_page_embeds_every_figure_that_exists(report):
    page = (report / "report.md").read_text(encoding="utf-8")
    shown = re.findall(r"!\[[^]]*\]\(([^)]+)\)", page)
    assert len(shown) == len(set(shown)) == 13
    assert set(shown) == {path.name for path in report.glob("*.png")}
    assert all(f"({name.replace('.png', '.pdf')})" in page for name in shown)
    image = imread(report / f"{SAVED}.png")
    assert image.shape[1] in (1003, 1004, 2066, 2067)  # 85 or 175 mm at 300 dpi
    assert image[..., :3].std() > 0.03
    assert (report / f"{SAVED}.pdf").read_bytes().startswith(b"%PDF")
    for table in re.findall(r"(?:^\|.*\n)+", page, re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert "19.36" in page
    first = page[: page.index("](fig")].index("](table1_losses.pdf)")
    sentence = (
        f"The number in the name of its file, as in fig3 or table1, is that of {paper.REFERENCE}"
    )
    assert sentence in page[:first]
    assert page.count("The number in the name") == 1
    assert "better than from two independent sets of profiles" in page
    assert "nan" not in page.replace("nano", "")


def test_the_same_file_gives_the_same_bytes(file, report, tmp_path):
    with few_figures(SAVED):
        write_report(file, tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert {"losses.csv", "curves.nc", "report.html", "loss_by_mechanism.pdf"} < names
    for name in names:
        assert (tmp_path / name).read_bytes() == (report / name).read_bytes(), name


def test_an_unfinished_campaign_is_reported_and_says_what_is_missing(
    tmp_path, capsys, quick_figures
):
    plan = campaign(hurst=(0.7, 0.8), gamma=(0.01, 0.04), realisations=3)
    values = rows(plan)
    values["status"][:] = [1, 1, 1, 1, 0, 2, 0, 0, 0, 1, 0, 0]
    values["error"] = np.zeros(12, dtype="S512")
    values["error"][5] = b"the sum diverged"
    path = write(tmp_path / "r.h5", plan, values)
    assert main(["report", str(path), "--to", str(tmp_path / "out" / "deep")]) == 0
    page = (tmp_path / "out" / "deep" / "report.md").read_text(encoding="utf-8")
    for text in (page, capsys.readouterr().out):
        assert "6 of 12 tasks are pending" in text
        assert "1 of 12 tasks failed" in text
        assert "No task is finished yet for H = 0.8, γ = 0.01 J/m²" in text
        assert "Only one realisation" in text
    assert "First reason: the sum diverged." in page
    assert "row 5: the sum diverged" in page
    assert len(quick_figures) == 13


def test_one_finished_task_of_one_cell_is_enough(tmp_path, quick_figures):
    path = write(tmp_path / "r.h5", campaign(hurst=(0.8,), gamma=(0.04,), realisations=1))
    parts: list[str] = []
    data = write_report(path, tmp_path / "out", progress=parts.append)
    assert data.done == 1
    # losses against H, m2 and γ would be single points
    assert not {"table1_losses", "loss_against_m2", "pull_off_stress"} & set(quick_figures)
    assert len(quick_figures) == 10
    figures = [f"figure {k} of 10, {name}" for k, name in enumerate(quick_figures, 1)]
    assert parts == ["averages", "tables", *figures, "pages"]


@pytest.mark.parametrize(
    ("losses", "verb"),
    [((1, 2, 1.9), "grows with"), ((3, 2, 1), "falls with"), ((1, 3, 2), "is not monotone in")],
)
def test_the_order_of_the_losses_in_m2_is_reported_as_one_through_hurst(losses, verb):
    cells = []
    for k, loss in enumerate(losses):
        means = {"m2": 1e-3 * (k + 1), "loss": loss, "loss_error": 0.1}
        estimates = {name: SimpleNamespace(mean=mean) for name, mean in means.items()}
        cells.append(SimpleNamespace(work_of_adhesion=0.04, done=9, estimates=estimates))
    data = SimpleNamespace(works_of_adhesion=(0.04,), cells=cells)
    (sentence,) = findings._order_in_slope(data, of_paper=False)
    assert sentence == f"Through H, the mean loss in J/m² {verb} m2 at γ = 0.04 J/m²."


def test_findings_compare_with_the_paper(data):
    text = "\n".join(findings.agreement(data))
    table = campaign_tables.beside_the_paper(data)
    assert len(table.rows) == 6
    off = []
    for row in table.rows:
        loss = data.finished(row[:1], row[1:2])[0].estimates["loss_dimensionless"]
        value = paper.TABLE_1.get(row[:2])
        assert row[3:7] == (loss.mean, loss.low, loss.high, value)
        if value is None:
            assert row[7:] == (None, None)
        else:
            off.append(loss.mean / value - 1)
            assert row[7] == off[-1]
            assert row[8] == ("yes" if loss.low <= value <= loss.high else "no")
    assert "Of the 8 losses of the paper's Table 1, 5 have a cell here" in text
    assert f"{100 * min(off):+.1f} % to {100 * max(off):+.1f} %" in text
    profiles = campaign_tables.profiles(data)
    names = [column.name for column in profiles.columns]
    slopes = [(row[names.index("m2_mean")], row[names.index("m2_paper")]) for row in profiles.rows]
    assert slopes[1] == (pytest.approx(0.002), 0.0027)
    assert "grows with γ at every H" in text
    ratios = [ratio for cell in data.cells if (ratio := findings.area_ratio(cell)) is not None]
    assert f"at least {min(ratios):.2f}" in text


def test_growth_is_claimed_where_it_is_known_alone(data):
    """Of the steps of γ, two of which have one side without results."""
    unknown = replace(data.cells[0], seed=data.cells[0].seed + 1)
    some = replace(data, cells=(unknown, *data.cells[1:]))
    every, known = (next(findings._growth(found, of_paper=False)) for found in (data, some))
    assert every.startswith("The loss in J/m² grows with γ at every H, profile by profile")
    assert known.startswith(
        "The loss in J/m² grows with γ in all 3 steps of γ that can be compared (1 cannot), profile"
    )


def test_contact_is_compared_at_equal_load():
    """Unloading has twice the contact of loading, or more, but where that is least or largest."""
    stress = np.linspace(-1, 3, 41)
    contact = 0.1 * (stress + 1.01)
    compared = (contact > 0.1 * contact[-1]) & (contact < 0.95 * contact[-1])
    more = contact * np.where(compared, 2 + 0.1 * np.cumsum(compared) - 0.1, 1)
    curves = {
        "loading_mean_stress_dimensionless": stress,
        "loading_contact_fraction": contact,
        "unloading_mean_stress_dimensionless": np.append(stress[::-1], [-0.5, 0.0]),
        "unloading_contact_fraction": np.append(more[::-1], [0.01, 0.0]),
    }
    curves = {name: SimpleNamespace(mean=mean) for name, mean in curves.items()}
    fake = SimpleNamespace(done=3, curves=curves)
    assert findings.area_ratio(fake) == pytest.approx(2)
    for name, curve in curves.items():  # loops that turn at a mean stress end at several places
        ends = [np.nan, np.nan]
        curve.mean = np.append(
            *((curve.mean, ends) if name.startswith("l") else (ends, curve.mean))
        )
    assert findings.area_ratio(fake) == pytest.approx(2)
    curves["unloading_mean_stress_dimensionless"].mean -= 10
    assert findings.area_ratio(fake) is None
    curves["unloading_mean_stress_dimensionless"].mean *= np.nan
    assert findings.area_ratio(fake) is None


def companion(tmp_path, name: str, factor: float, old: str, new: str) -> Path:
    """The campaign of ``file`` with a line replaced, its losses multiplied by a factor."""
    alike = campaign(**PLAN)
    assert old in alike.text
    plan, values = parse_campaign(alike.text.replace(old, new)), rows(alike)
    values |= {n: values[n] * factor for n in ("loss", "loss_dimensionless")}
    short = {n for n, v in values.items() if "loading_" in n or n.startswith(("psd", "gap_d"))}
    return write(tmp_path / name, plan, {n: v for n, v in values.items() if n not in short})


def test_errors_come_from_the_audit_and_from_campaigns_beside(file, data, tmp_path):
    solver = "[solver]\naccuracy = 1e-4\n[output]"
    finer = companion(tmp_path, "finer.h5", 1.02, "[output]", solver)
    steps = companion(tmp_path, "steps.h5", 0.99, "load_steps = 20", "load_steps = 40")
    alone = {row[:2]: row for row in campaign_tables.losses(data).rows}
    both = aggregate(file, [finer, steps])
    doubts = [text for text in findings.quality(both) if "beside this campaign" in text]
    wrong = [row["row"] for row in read_status(finer)["doubtful"]]
    wrong += [row["row"] for row in read_status(finer)["beyond_limit"]]
    assert doubts[0].startswith(f"WARNING: {len(set(wrong))} of 30 losses of finer.h5, beside")
    assert not any("beside this campaign" in text for text in findings.quality(data))
    other = write(tmp_path / "other.h5", text_of(**PLAN).replace("seed = 1", "seed = 2"))
    said = "WARNING: other.h5, beside this campaign, shares no loop with it."
    assert said in findings.quality(aggregate(file, [other]))
    assert [c.kind for c in both.companions] == ["resolution", "load steps"]
    assert both.companions[1].differs == ("cycle.load_steps = 40",)
    names = [column.name for column in campaign_tables.losses(both).columns]
    by_steps = names.index("loss_dimensionless_error_load_steps")
    by_grid = names.index("loss_dimensionless_error_resolution")
    for row in campaign_tables.losses(both).rows:
        cell = data.finished(row[:1], row[1:2])[0]
        loss = cell.values["loss_dimensionless"]
        assert row[by_grid] == pytest.approx(0.02 * loss.mean())
        assert row[by_steps] == pytest.approx(0.01 * loss.mean())
        assert alone[row[:2]][by_grid] is None
        audit = np.abs(cell.values["loss"] - cell.values["loss_from_drops"]) / cell.values["loss"]
        assert alone[row[:2]][by_steps] == pytest.approx(np.mean(audit * loss))
    difference = "± steps: the difference from the campaign with other load steps beside this one"
    assert f"{difference};" in campaign_tables.losses(both).notes()
    with h5py.File(steps, "r+") as other:
        other["status"][:5] = 0
    some = campaign_tables.losses(aggregate(file, [steps]))
    assert some.rows[0][by_steps] == alone[some.rows[0][:2]][by_steps]
    assert f"{difference}, mean |loop integral - sum of drops| where that lacks a cell;" in (
        some.notes()
    )


@pytest.mark.usefixtures("no_figures")
def test_another_largest_penetration_is_compared_with(file, tmp_path):
    depths = "max_penetration = 0.9", "max_penetration = 0.6"
    lower = companion(tmp_path, "lower.h5", 0.5, *depths)
    data = write_report(file, tmp_path / "out", beside=[lower])
    assert "cycle.max_penetration = 0.6" in write_page(data, {})
    assert (tmp_path / "out" / "beside.csv").read_text().count("\n") == 7
    write_report(file, tmp_path / "out")
    assert not (tmp_path / "out" / "beside.csv").exists()


def test_the_page_begins_with_what_came_out_and_how_well_it_is_known(data, report):
    outcome, statistical, numerical = findings.verdict(data)
    means = [1e3 * cell.estimates["loss"].mean for cell in data.cells]
    assert f"from {min(means):.3g} mJ/m²" in outcome
    assert f"to {max(means):.3g} mJ/m²" in outcome
    scales = [[c.values[f"loss_{of}_scale"].sum() for c in data.cells] for of in ("small", "large")]
    share = 100 * np.array(scales[0]) / np.sum(scales, axis=0)
    assert f"; {share.min():.0f} to {share.max():.0f} % of it is lost" in outcome
    errors = [
        max(e.high - e.mean, e.mean - e.low) / e.mean
        for e in (cell.estimates["loss"] for cell in data.cells)
    ]
    assert "5 realisations" in statistical
    least, most = (float(f"{100 * half:.2g}") for half in (min(errors), max(errors)))
    assert f"mean loss in J/m² reaches {least:g} to {most:g} % from it" in statistical
    assert "at most 0.01 % of it" in numerical
    audit = max(np.abs(cell.values["audit_residual"]).max() for cell in data.cells)
    assert f"closes within {100 * audit:.2g} %" in numerical
    raced = sum(int((cell.values["races"] > 0).sum()) for cell in data.cells)
    assert f"in {raced} of 30 loops other speeds, order or a finer field" in numerical
    assert "at most 2 % of a loss" in numerical
    head = (report / "report.md").read_text(encoding="utf-8").split("\n\n")[1]
    assert head == " ".join(findings.verdict(data))


def test_doubtful_losses_and_steep_profiles_are_said(tmp_path):
    plan = campaign(hurst=(0.7,), gamma=(0.01, 0.02), realisations=4)
    values = rows(plan)
    values["audit_residual"][:] = 1e-5
    clean = aggregate(write(tmp_path / "clean.h5", plan, values))
    assert not any("WARNING" in text for text in findings.quality(clean))
    values["audit_residual"][2] = -0.19
    values["loss_error"][5] = 0.03 * values["loss"][5]
    values["m2"][4:] = 1.2**2
    data = aggregate(write(tmp_path / "r.h5", plan, values))
    doubtful, steep = (text for text in findings.quality(data) if "WARNING" in text)
    assert "2 of 8 losses are doubtful" in doubtful
    assert doubtful.index("row 2, H = 0.7, γ = 0.01 J/m² (19 %)") < doubtful.index("row 5")
    first = write_page(data, {}).split("\n\n")[2]
    assert f"- {doubtful}" in first.splitlines()  # above the numbers that are doubted
    assert "slope exceeds" in steep
    assert "γ = 0.02" in steep
    assert "γ = 0.01" not in steep


def test_a_report_compares_and_doubts_no_loss_without_adhesion(tmp_path):
    plan = campaign(hurst=(0.7,), gamma=(0.0, 0.02), realisations=4)
    values = rows(plan)
    values["audit_residual"][:] = 1e-5
    none = values["work_of_adhesion"] == 0
    values["loss"][none] = values["loss_error"][none] = 1e-13
    values["edge_range"][none] = 0.0
    values["largest_contact_fraction"][:] = 0.5
    data = aggregate(write(tmp_path / "r.h5", plan, values))
    *sentences, last = findings.verdict(data)
    assert last == "Without adhesion (γ = 0) nothing is lost."
    assert not any("γ = 0 " in text for text in sentences)
    assert "at most 0.01 % of it" in sentences[2]
    assert not any("WARNING" in text or "below 0 nm" in text for text in findings.quality(data))
    known = [np.isfinite(cell.estimates["loss"].low) for cell in data.cells]
    assert known == [False, True]
    table = campaign_tables.losses(data)
    shown = table.markdown().splitlines()[2].split("|")
    assert "0.000" in shown[4]  # rounding is no loss
    place = [column.name for column in table.columns].index("loss_mean [J/m^2]")
    assert table.rows[0][place] == 0
    values["status"][1:] = 0
    values["jump_kind"][none] = -1
    data = aggregate(write(tmp_path / "none.h5", plan, values))
    assert findings.verdict(data) == [last]
    assert np.isnan(data.cells[0].estimates["loss"].std)  # of one loop
    assert "jump_energies" not in {figure.name for figure in catalogue.sections(data)["mechanisms"]}
    with few_figures(), pytest.warns(UserWarning, match="no positive values"):
        loss_figures.jump_energies(data).finish()  # asked for from Python


def test_losses_beyond_the_zero_range_limit_are_said(tmp_path):
    plan = campaign(hurst=(0.7,), gamma=(0.01, 0.02), realisations=4)
    values = rows(plan)
    values["audit_residual"][:] = 1e-5
    values["largest_contact_fraction"][:] = 0.5
    sound = aggregate(write(tmp_path / "sound.h5", plan, values))
    least = values["valid_range"].min()
    (sentence,) = (text for text in findings.quality(sound) if "zero-range limit holds" in text)
    assert f"well below {1e9 * least:.3g} nm" in sentence
    assert not read_status(tmp_path / "sound.h5")["beyond_limit"]
    values["valid_range"][2] = 0.5e-9
    values["valid_range"][3] = np.inf
    values["touch_range"][5] = 0.4e-9
    values["edge_range"][7] = 0.3e-9
    values["turn_range"][4] = 0.2e-9
    values["loss"][6] = 21 * 0.02 * 0.5
    for name in ("valid_range", "edge_range", "touch_range"):
        values[name][6] = np.inf
    path = write(tmp_path / "r.h5", plan, values)
    data, status = aggregate(path), read_status(path)
    (warning,) = (text for text in findings.quality(data) if "turn_range is below" in text)
    assert warning.startswith("WARNING: 5 of 8 losses")
    assert [row["row"] for row in status["beyond_limit"]] == [4, 7, 5, 2, 6]
    ranges = "valid_range, edge_range, touch_range or turn_range"
    doubt = f"5 losses are doubtful: {ranges} is below 1e-09 m"
    assert doubt in as_text(status)
    assert "touch_range 4e-10 m" in as_text(status)
    assert "row 6: H = 0.7, γ = 0.02 J/m², realisation 2" in as_text(status)
    assert "no finite range, loss 0.21 J/m²" in as_text(status)
    table = campaign_tables.losses(data)
    names = [column.name for column in table.columns]
    shown = [row[names.index("valid_range_least [m]")] for row in table.rows]
    assert shown == pytest.approx([0.5e-9, values["valid_range"][4:].min()])
    shown = [row[names.index("range_least [m]")] for row in table.rows]
    assert shown == pytest.approx([0.5e-9, 0.2e-9])


def test_losses_at_a_range_that_matters_beyond_touches_are_said(tmp_path):
    """By their tension over the strength, or a range that is long beside edge_range; with zones."""
    text = text_of(hurst=(0.7,), gamma=(0.02,), realisations=4)
    plan = parse_campaign(text.replace("poisson = 0.5", "poisson = 0.5\nstrength = 1e9"))
    values = rows(plan)
    values["audit_residual"][:] = 1e-5
    values["opening_strength"][:] = 1e9
    values["valid_range"][:] = 0.02 / 1e9
    sound = write(tmp_path / "sound.h5", plan, values)
    assert not read_status(sound)["beyond_limit"]
    values["valid_range"][1] /= 1.02
    values["edge_range"][3] = 0.02 / 1e9
    values["touch_range"][2] = 0.99 * 0.02 / 1e9
    values["zone_error"][:] = [1e-6, 2e-6, 3e-6, 4e-6]
    path = write(tmp_path / "r.h5", plan, values)
    table = campaign_tables.losses(aggregate(path))
    (place,) = (k for k, column in enumerate(table.columns) if column.heading == "± zones")
    assert table.columns[place].name == "zone_error_mean [J/m^2]"
    assert table.rows[0][place] == pytest.approx(2.5e-6)
    assert (
        "± zones: mean change of the loss by cohesive zones at edges, in mJ/m²; " in table.notes()
    )
    assert "to be set beside the range of adhesion that is given" in table.notes()
    plan = parse_campaign(text.replace("poisson = 0.5", "poisson = 0.5\nstrength = [inf, 1e9]"))
    opening, zero = findings.law(aggregate(write(tmp_path / "two.h5", plan, rows(plan))))
    assert opening.startswith("Adhesion has a strength of 1 GPa: its range, a gap")
    assert zero == "Where the strength is inf, the range of adhesion is zero."
    status = read_status(path)
    assert [row["row"] for row in status["beyond_limit"]] == [1, 2, 3]
    assert "3 losses are doubtful: the tension inside patches exceeds" in as_text(status)
    (warning,) = (
        text for text in findings.quality(aggregate(path)) if "patches would open" in text
    )
    assert warning.startswith("WARNING: 3 of 4 losses")


def test_the_method_of_the_interval_is_the_one_that_was_used(tmp_path):
    for n, named, other in (
        (3, "by Student's t", "Hall"),
        (10, "Hall's transformation", "fewer than"),
    ):
        plan = campaign(hurst=(0.7,), gamma=(0.01,), realisations=n)
        page = write_page(aggregate(write(tmp_path / f"{n}.h5", plan)), {})
        assert named in page
        assert other not in page


def test_the_html_page_needs_no_other_file(report):
    page = (report / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|href)="(?!data:image/png|\w+\.pdf")', page)
    images = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert {base64.b64decode(text) for text in images} == {
        path.read_bytes() for path in report.glob("*.png")
    }
    assert len(images) == 13
    markdown = (report / "report.md").read_text(encoding="utf-8")
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", page)
    assert len(cells) == sum(
        line.count("|") - 1
        for table in re.findall(r"(?:^\|.*\n)+", markdown, re.MULTILINE)
        for line in table.splitlines()[2:]
    )


@needs_browser
def test_a_browser_shows_every_figure_of_the_report_and_no_error(report, tmp_path):
    page = (report / "report.html").read_text(encoding="utf-8")
    watch = "<head><script>errors = []; onerror = e => errors.push(e);</script>"
    report_seen = "onload = () => reportSeen({errors, widths: [...document.images].map(width)});"
    script = f"const width = image => image.naturalWidth; {report_seen}"
    found = seen_by_browser(page.replace("<head>", watch), script, tmp_path)
    assert found["errors"] == []
    assert len(found["widths"]) == 13
    assert min(found["widths"]) > 0


def test_texts_of_a_results_file_are_shown_as_texts(data, tmp_path):
    """An error text that asks for a file by its path does not get it, nor does any other text."""
    secret = tmp_path / "secret.png"
    secret.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    hostile = f"![x]({secret}) <script> | `a` \x1b[31m\n\n![y]({secret})\n"
    text = f"# {hostile}```\n![z]({secret})\n<script>\n````\n{data.campaign.text}"
    evil = replace(
        data,
        path=Path(f"![name]({secret.name})`.h5"),
        failures=[(3, hostile)],
        attributes={"adhesis_version": hostile, "mpi": hostile},
        campaign=replace(data.campaign, text=text),
    )
    page = write_page(evil, {})
    assert "\x1b" not in page
    (tmp_path / "report").mkdir()
    for folder in (tmp_path / "report", tmp_path):  # also where the image is the report's own
        html = html_page(page, folder)
        assert "<img" not in html
        assert "<script" not in html
        assert html.count(f"![y]({secret})") == 4  # failure, two attributes, campaign


def test_campaigns_that_come_along_are_comparable_with_the_paper_campaign():
    base = load_campaign(ROOT / "jobs" / "paper.toml")
    others = ("ratio-200", "equal-c0", "penetration-0.6", "penetration-0.93")
    kinds = {"steps-80": "load steps", "accuracy-1e-4": "resolution"}
    kinds |= dict.fromkeys(others, "other")
    files = {path.stem: path for path in (ROOT / "jobs" / "beside").glob("*.toml")}
    assert set(files) == set(kinds)
    for name, path in files.items():
        other = load_campaign(path)
        assert kind_of(differing_keys(base, other)) == kinds[name]
        assert other.sweep.seed == base.sweep.seed
        assert set(other.sweep.work_of_adhesion) <= set(base.sweep.work_of_adhesion)
        if name in ("ratio-200", "equal-c0"):
            for task in list(other.tasks())[:: other.sweep.realisations]:
                quoted = paper.m2(task.hurst)
                assert make_problem(other, task).profile.m2 == pytest.approx(quoted, rel=0.05)


def test_loops_of_a_machine_are_drawn_against_its_own_penetration(tmp_path):
    text = text_of(hurst=(0.7,), gamma=(0.04,), realisations=2)
    text = text.replace("[cycle]", "[cycle]\nstiffness = 1e9")
    data = aggregate(write(tmp_path / "r.h5", text))
    with style():
        figure = loops.loop_against_penetration(data)
    assert "u_\\mathrm{tot}" in figure.axes[0].get_xlabel()
    assert "| u_tot/h_max |" in campaign_tables.slopes(data).markdown().splitlines()[0]
