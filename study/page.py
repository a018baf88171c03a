"""The pages of the study: tables are written between the marks that name them."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from pathlib import Path

from study.data import Study
from study.findings import amplitude_findings, answer_text, findings
from study.more_readings import more_findings
from study.sentences import (
    answer_note,
    coverage_note,
    profiles_note,
    readings_note,
    scaling_note,
)
from study.table1 import all_readings
from study.tables import TABLES
from study.text import Table

ALL: dict[str, Callable[[Study], Table | str]] = {
    "answer_text": answer_text,
    "answer_note": answer_note,
    "coverage_note": coverage_note,
    "profiles_note": profiles_note,
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


def write_pages(folder: Path) -> list[Path]:
    """Compute the tables of the pages and readings.csv; return the files that changed."""
    study = Study.at(folder)
    texts = {page: filled(page.read_text("utf-8"), study) for page in sorted(folder.glob("*.md"))}
    header, rows = all_readings(study)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([[cell.replace("\\|", "|") for cell in header], *rows])
    texts[folder / "data" / "readings.csv"] = stream.getvalue()
    changed = [path for path, text in texts.items() if path.read_text("utf-8") != text]
    for path in changed:
        path.write_text(texts[path], encoding="utf-8")
    return changed
