"""The report of a campaign, from its results file alone: tables, curves, figures, one page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from adhesis.ensemble.aggregate.average import Aggregate, aggregate
from adhesis.ensemble.escape import printable
from adhesis.ensemble.files import Writing, staged_folder


def write_report(
    path: Path | str,
    directory: Path | str,
    beside: Sequence[Path | str] = (),
    progress: Callable[[str], None] = lambda part: None,
) -> Aggregate:
    """Write ``losses.csv``, ``curves.nc``, figures, ``report.md`` and ``report.html``.

    ``beside`` are results files to compare with; tables are printed. ``progress`` is called with
    the name of each part before it is made. InputError if there is nothing to report, WriteError if
    the directory cannot be written; what was there is left as it was.
    """
    progress("averages")
    data = aggregate(path, beside)
    directory = Path(directory)
    writing = Writing()
    with (
        writing.output("the report in", directory),
        staged_folder(directory, _older_files(directory)) as folder,
    ):
        _write_files(data, folder, progress)
    writing.finish()
    _print_summary(data, directory)
    return data


def _older_files(directory: Path) -> list[str]:
    """Return the files that an earlier report can have left, and that not every report writes."""
    from adhesis.ensemble.report.figures.catalogue import ALL

    figures = [*directory.glob("*.png"), *directory.glob("*.pdf")]
    known = {item.name for item in ALL}
    found = [f.name for f in figures if f.stem in known or f.stem.startswith("loss_along_")]
    return ["precision.csv", "beside.csv", *found]


def _write_files(data: Aggregate, directory: Path, progress: Callable[[str], None]) -> None:
    progress("tables")
    # Imported here: matplotlib and xarray take a second, and a bad file is refused at once.
    from adhesis.ensemble.report.figures.catalogue import sections
    from adhesis.ensemble.report.figures.style import save, style
    from adhesis.ensemble.report.html import html_page
    from adhesis.ensemble.report.markdown_page import write_page
    from adhesis.ensemble.report.opened import curves_dataset
    from adhesis.ensemble.report.tables import campaign_tables

    tables = {
        "losses": campaign_tables.losses(data),
        "growth": campaign_tables.paired(data),
        "jumps": campaign_tables.jumps(data),
        "works": campaign_tables.works(data),
        "slopes": campaign_tables.slopes(data),
    }
    if (known := campaign_tables.precision(data)).rows:
        tables["precision"] = known
    if data.companions:
        tables["beside"] = campaign_tables.companions(data)
    for name, table in tables.items():
        table.write_csv(directory / f"{name}.csv")
    # In memory: HDF5 reports a full disk when the file is closed, and ends the process with a
    # segmentation fault where the library closes it at exit. The view is released at once, as one
    # that an error keeps alive is reported at the exit.
    with memoryview(curves_dataset(data).to_netcdf(None, engine="h5netcdf")) as curves:
        (directory / "curves.nc").write_bytes(curves)
    figures = sections(data)
    items = [item for illustrations in figures.values() for item in illustrations]
    for number, item in enumerate(items, 1):
        progress(f"figure {number} of {len(items)}, {item.name}")
        with style():
            figure = item.of(data)
        save(figure, directory / item.name)
    progress("pages")
    page = write_page(data, figures)
    (directory / "report.md").write_text(page, encoding="utf-8")
    (directory / "report.html").write_text(html_page(page, directory), encoding="utf-8")


def _print_summary(data: Aggregate, directory: Path) -> None:
    from adhesis.ensemble.report import findings
    from adhesis.ensemble.report.tables import campaign_tables

    for make in (campaign_tables.losses, campaign_tables.precision, campaign_tables.mechanisms):
        if (table := make(data)).rows:
            print(table, end="\n\n")
    for sentence in (
        *findings.verdict(data),
        *findings.law(data),
        *findings.precision(data),
        *findings.missing(data),
        *findings.quality(data),
    ):
        print(printable(sentence))
    pages = f"{directory / 'report.md'}, {directory / 'report.html'}"
    print(f"report: {printable(pages)}")
