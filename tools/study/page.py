"""The pages of the study: tables are written between the marks that name them."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

from tools.study.data import Study
from tools.study.findings import amplitude_findings, answer_text, findings
from tools.study.more_readings import more_findings
from tools.study.sentences import answer_note, coverage_note, readings_note, scaling_note
from tools.study.table1 import all_readings
from tools.study.tables import TABLES
from tools.study.text import Table

ALL: dict[str, Callable[[Study], Table | str]] = {
    "answer_text": answer_text,
    "answer_note": answer_note,
    "coverage_note": coverage_note,
    "scaling_note": scaling_note,
    "readings_note": readings_note,
    "findings": findings,
    "amplitude_findings": amplitude_findings,
    "more_findings": more_findings,
    **TABLES,
}

_PLACE = re.compile(r"<!-- table (\w+) -->\n.*?<!-- end -->", re.DOTALL)


def markdown(table: Table | str) -> str:
    """Return a table, or a paragraph, as Markdown."""
    if isinstance(table, str):
        return table
    header, rows = table
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def filled(text: str, study: Study) -> str:
    """Return a page with its tables computed anew."""

    def table(match: re.Match[str]) -> str:
        name = match[1]
        return f"<!-- table {name} -->\n{markdown(ALL[name](study))}\n<!-- end -->"

    return _PLACE.sub(table, text)


def write_page(folder: Path) -> None:
    """Compute the tables of the pages, and readings.csv with every reading."""
    study = Study.at(folder)
    for page in sorted(folder.glob("*.md")):
        page.write_text(filled(page.read_text(encoding="utf-8"), study), encoding="utf-8")
    with (folder / "readings.csv").open("w", newline="", encoding="utf-8") as stream:
        header, rows = all_readings(study)
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([cell.replace("\\|", "|") for cell in header])
        writer.writerows(rows)
