"""Compare the methods with exact references: error against bound.

Exit code 1 if a bound is exceeded.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.exit_codes import DONE, SOME_FAILED

if TYPE_CHECKING:
    from adhesis.solver.validate.claims import Row

_SEVERAL = {"action": "append"}
EXAMPLES = ("adhesis validate", "adhesis validate --method sharp --json")


OPTIONS = (
    ("--method NAME", None, "method to validate, may be repeated (default: all)", _SEVERAL),
    ("--json", bool, "print the rows as JSON"),
)


def execute(args: argparse.Namespace) -> int:
    """Run the references and print what came out."""
    from adhesis.solver.validate.claims import METHODS, validate
    from adhesis.solver.values import finite

    names = [name for name in METHODS if not args.method or name in args.method]
    for name in args.method or ():
        if name not in METHODS:
            raise InputError(f"--method is {name!r}: it must be one of {', '.join(METHODS)}")
    stream = sys.stderr if args.json else sys.stdout
    rows = validate(names, on_row=lambda row: print(_line(row), file=stream, flush=True))
    failed = [row for row in rows if not row.passed]
    if args.json:
        found = [asdict(row) | {"passed": row.passed} for row in rows]
        # JSON has no NaN: a method that did not get there has no error.
        known = [{k: finite(v) if isinstance(v, float) else v for k, v in f.items()} for f in found]
        print(json.dumps(known, indent=1, allow_nan=False))
    else:
        print(f"{len(rows) - len(failed)} of {len(rows)} claims hold")
    return SOME_FAILED if failed else DONE


def _line(row: Row) -> str:
    verdict = "ok  " if row.passed else "FAIL"
    note = f"  ({row.note})" if row.note else ""
    error = f"{row.error:8.1e} <= {row.bound:7.1e}"
    return f"{verdict}  {error}  {row.method:<5}  {row.claim}  [{row.resolution}]{note}"
