"""Draw anew for as long as is asked: every program of tools/fuzz/ gets its share of the time.

    python tools/fuzz.py --seconds 600 [--seed N] [--only NAME]

Each is called as ``PROGRAM --seed N --seconds T``, draws from that seed alone, stops by itself at
the end of its time and exits with 1 if it found a failure, having printed what repeats it.
"""

from __future__ import annotations

import argparse
import secrets
import subprocess
import sys
from pathlib import Path

PROGRAMS = Path(__file__).resolve().parent / "fuzz"


def main() -> int:
    """Run them one after another; returns 1 if one found something."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--only", help="the name of one program")
    args = parser.parse_args()
    seed = secrets.randbelow(2**32) if args.seed is None else args.seed
    programs = [p for p in sorted(PROGRAMS.glob("*.py")) if args.only in (None, p.stem)]
    if not programs:
        parser.error(f"--only is {args.only!r}: there is no such program in {PROGRAMS}")
    failed = []
    for program in programs:
        share = args.seconds / len(programs)
        print(f"fuzz: {program.stem}, seed {seed}, {share:.0f} s", flush=True)
        words = [sys.executable, program, "--seed", str(seed), "--seconds", str(share)]
        if subprocess.run(words, check=False).returncode != 0:
            failed.append(program.stem)
    for name in failed:
        print(f"fuzz: {name} failed; again: python tools/fuzz.py --only {name} --seed {seed}")
    if not failed:
        print(f"fuzz: nothing found (seed {seed})")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
