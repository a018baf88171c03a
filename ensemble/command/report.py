"""Write tables, curves and figures of a results file, finished or not."""

from __future__ import annotations

import argparse
from pathlib import Path

from adhesis.ensemble.files import check_output_folder
from adhesis.ensemble.reporter import bar

EXAMPLES = (
    "adhesis report paper.h5 --to report",
    "adhesis report paper.h5 --to report --beside fine.h5",
)
_TABLES = ("losses", "precision", "growth", "jumps", "works", "beside", "slopes")
_FILES = (*(f"{name}.csv" for name in _TABLES), "curves.nc", "report.md", "report.html")


_TO = "directory for losses.csv, curves.nc, the figures, report.md and report.html"
_BESIDE = (
    "other campaigns to compare with, loop by loop: another resolution or method, other load "
    "steps, another largest penetration, another spectrum"
)
OPTIONS = (
    ("file FILE.h5", Path, "results file of a campaign"),
    ("--to DIR", Path, _TO, {"required": True}),
    ("--beside OTHER.h5", Path, _BESIDE, {"nargs": "+", "default": []}),
)


def execute(args: argparse.Namespace) -> None:
    """Write the report."""
    inputs = {"the command": args.file}
    inputs |= {f"--beside (number {k})": path for k, path in enumerate(args.beside, 1)}
    check_output_folder("--to", args.to, _FILES, inputs)
    from adhesis.ensemble.report.write_report import write_report

    with bar("adhesis report", last=False) as show:
        write_report(
            args.file,
            args.to,
            beside=args.beside,
            progress=lambda part: show(None, None, f"adhesis report: {part}"),
        )
