"""The study of docs/study/: one command for its numbers.

python -m tools.study collect FOLDER    results files of the campaigns -> docs/study/*.csv
python -m tools.study page              docs/study/*.csv -> tables of the page, figures
python -m tools.study figures --to OUT  docs/study/*.csv -> figures
"""

from __future__ import annotations

import argparse
from pathlib import Path

STUDY = Path(__file__).resolve().parent.parent.parent / "docs" / "study"


def main() -> None:
    """Read the command line and do it."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.study", description=__doc__, allow_abbrev=False
    )
    commands = parser.add_subparsers(dest="command", required=True)
    collect = commands.add_parser(
        "collect", help="results files to small tables", allow_abbrev=False
    )
    collect.add_argument("folder", type=Path)
    page = commands.add_parser(
        "page", help="small tables to the page and its figures", allow_abbrev=False
    )
    figures = commands.add_parser("figures", help="small tables to figures", allow_abbrev=False)
    figures.add_argument("--to", type=Path, required=True, help="an existing folder")
    for command in (collect, page, figures):
        command.add_argument("--study", type=Path, default=STUDY, help="folder of page and tables")
    args = parser.parse_args()
    if args.command == "collect":
        from tools.study.collect import collect_all

        collect_all(args.folder, args.study)
        return
    from tools.study.figures import draw_all

    if args.command == "page":
        from tools.study.page import write_page

        write_page(args.study)
    draw_all(args.study, args.to if args.command == "figures" else args.study)


if __name__ == "__main__":
    main()
