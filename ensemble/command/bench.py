"""Measure the speed of each method against its error in the loss; write table and figure.

Every run has a process of its own with one thread; time is CPU time, so other work on the machine
does not count. The full benchmark takes three quarters of an hour at most, --quick less than a
minute.
"""

from __future__ import annotations

import argparse
import platform
import sys
from pathlib import Path

from adhesis.ensemble.command.parser import within
from adhesis.ensemble.files import Writing, check_output_folder, staged_folder
from adhesis.ensemble.reporter import bar

_DEFAULT = Path("out/benchmark")
_TO = f"directory for benchmark.csv, benchmark.md and the figure (default {_DEFAULT})"
EXAMPLES = ("adhesis bench --quick", "adhesis bench --to out/benchmark --budget 60")
_FILES = tuple(f"benchmark.{suffix}" for suffix in ("csv", "md", "png", "pdf"))


OPTIONS = (
    ("--to DIR", Path, _TO, {"default": _DEFAULT}),
    ("--quick", bool, "small scenes only, under a minute"),
    (
        *("--budget SECONDS", within(1e-9, 1e9, "a positive number of seconds")),
        *("CPU time after which a run is given up (default 360)", {"default": 360.0}),
    ),
)


def execute(args: argparse.Namespace) -> None:
    """Measure, print and write what came out."""
    from adhesis.ensemble.bench.benchmark import COLUMNS, benchmark, page
    from adhesis.ensemble.bench.scenes import FULL, QUICK
    from adhesis.ensemble.report.tables.table import make_table
    from adhesis.ensemble.versions import processor

    check_output_folder("--to", args.to, _FILES, {})
    lines = []
    with bar("adhesis bench: measuring", last=False) as show_run:
        for line in benchmark(QUICK if args.quick else FULL, seconds=args.budget):
            lines.append(line)
            run = line.run
            if not sys.stderr.isatty():  # no bar there, and a job may end before the last run
                row = make_table("", COLUMNS, [line]).markdown().splitlines()[-1]
                print(run.scene.name, row, file=sys.stderr)
            show_run(None, None, f"{run.scene.title}: {run.method}, {run.described}")
    machine = f"one core of {processor()}, Python {platform.python_version()}"
    command = "adhesis bench --quick" if args.quick else "adhesis bench"
    text = page(lines, f"`{command}` on {machine}")
    print(text)
    from adhesis.ensemble.bench.bench_figure import draw  # matplotlib, when all is measured
    from adhesis.ensemble.report.figures.style import save

    writing = Writing()
    with writing.output("the benchmark in", args.to), staged_folder(args.to) as folder:
        make_table("", COLUMNS, lines).write_csv(folder / "benchmark.csv")
        (folder / "benchmark.md").write_text(text, encoding="utf-8")
        save(draw(lines), folder / "benchmark")
    writing.finish()
    print(f"wrote {args.to}/benchmark.csv, benchmark.md, benchmark.png and benchmark.pdf")
