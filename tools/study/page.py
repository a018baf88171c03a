"""The page of the study: its tables are written between the marks that name them."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from tools.study.data import Study
from tools.study.findings import findings
from tools.study.table1 import all_readings
from tools.study.tables import TABLES
from tools.study.text import Table

ALL = {"findings": findings, **TABLES}

_PLACE = re.compile(r"<!-- table (\w+) -->\n.*?<!-- end -->", re.DOTALL)


def markdown(table: Table) -> str:
    """Return a table as Markdown."""
    header, rows = table
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def filled(text: str, study: Study) -> str:
    """Return the page with its tables computed anew."""

    def table(match: re.Match[str]) -> str:
        name = match[1]
        return f"<!-- table {name} -->\n{markdown(ALL[name](study))}\n<!-- end -->"

    return _PLACE.sub(table, text)


def write_page(folder: Path) -> None:
    """Compute the tables of the page, and readings.csv with every reading."""
    study = Study.at(folder)
    page = folder / "README.md"
    page.write_text(filled(page.read_text(encoding="utf-8"), study), encoding="utf-8")
    with (folder / "readings.csv").open("w", newline="", encoding="utf-8") as stream:
        header, rows = all_readings(study)
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([cell.replace("\\|", "|") for cell in header])
        writer.writerows(rows)
