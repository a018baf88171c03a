"""Make the numbers of the study.

python -m study page              data/*.csv -> tables of the pages, readings.csv, figures
python -m study collect FOLDER    results files of the campaigns -> data/loops.csv, data/jumps.csv
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def main() -> int:
    """Read the command line and do it; returns 1 if a page was not what the data make."""
    parser = argparse.ArgumentParser(
        prog="python -m study",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser(
        "page", help="small tables to the pages and their figures", allow_abbrev=False
    )
    collect = commands.add_parser(
        "collect", help="results files to small tables", allow_abbrev=False
    )
    collect.add_argument("folder", type=Path, help="where the results files are")
    args = parser.parse_args()
    if args.command == "collect":
        from study.collect import collect_all

        collect_all(args.folder, HERE)
        return 0
    from study.figures import draw_all
    from study.page import write_pages

    changed = write_pages(HERE)
    draw_all(HERE)
    for path in changed:
        print(f"{path} was not what the data make, and is written anew: look at the difference")
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
