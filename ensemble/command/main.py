"""``adhesis COMMAND …``: what commands there are, and the call of one.

A command's module is imported only when it is called, so that ``status`` and ``report`` never load
MPI.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys

from ensemble.errors import InputError, WriteError
from ensemble.run.launch import ONE_THREAD

COMMANDS: dict[str, str] = {
    "run": "run or resume a campaign; under mpirun, rank 0 hands out and the others work",
    "status": "what of a results file is pending, done and failed",
    "merge": "join the results files of parts, as --part has made them, into one",
    "report": "tables, curves and figures of a results file",
    "loop": "one loop of one profile",
    "trace": "a measured trace to its loss, with what is doubtful about it",
    "validate": "the exact references: error against bound",
    "bench": "speed against error of each method",
    "warm": "compile both methods now, for all users of this installation",
    "doctor": "which MPI, HDF5, FFTW and writer this installation uses, and why",
}
BAD_INPUT = 2
WRITE_FAILED = 74


def main(argv: list[str] | None = None) -> int:
    """Run one command; returns its exit code (2 for bad input, with one sentence on stderr)."""
    words = sys.argv[1:] if argv is None else argv
    name = words[0] if words else ""
    if name == "--version":
        from ensemble.versions import adhesis_version

        print(f"adhesis {adhesis_version()}")
        return 0
    if name not in COMMANDS:
        _overview().parse_args(words or ["--help"])
        return BAD_INPUT
    for variable, count in ONE_THREAD.items():
        os.environ.setdefault(variable, count)  # before numpy is loaded
    module = importlib.import_module(f"ensemble.command.{name}")
    parser = argparse.ArgumentParser(prog=f"adhesis {name}", description=module.__doc__)
    module.add_arguments(parser)
    args = parser.parse_args(words[1:])
    args.words = words
    try:
        code: int = module.execute(args)
    except InputError as error:
        print(f"adhesis {name}: {error}", file=sys.stderr)
        return BAD_INPUT
    except WriteError as error:
        print(f"adhesis {name}: {error}", file=sys.stderr)
        return WRITE_FAILED
    except BrokenPipeError:
        return 1
    return code


def _overview() -> argparse.ArgumentParser:
    listing = "\n".join(f"  {name:<10}{text}" for name, text in COMMANDS.items())
    parser = argparse.ArgumentParser(
        prog="adhesis",
        description="Hysteresis loops of rough contacts with zero-range (JKR) adhesion.",
        epilog=f"commands:\n{listing}\n\nadhesis COMMAND --help tells more.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="version and commit")
    parser.add_argument("command", choices=list(COMMANDS), metavar="COMMAND")
    return parser
