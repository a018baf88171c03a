"""Draw anew for as long as is asked: each part gets its share of the time.

    python tools/fuzz.py --seconds 600 [--seed N] [--only NAME]

Parts are the programs of tools/fuzz/, and ``properties``, the property tests of the suite. Each
draws from the seed alone, stops by itself at the end of its time and exits with 1 if it found a
failure, having printed what repeats it.
"""

import argparse
import os
import secrets
import subprocess
import sys
import time
from pathlib import Path

TOOLS = Path(__file__).resolve().parent


def properties(seed: int, seconds: float) -> bool:
    """Run the property tests with new examples, round after round; returns whether all hold."""
    end, anew = time.monotonic() + seconds, os.environ | {"ADHESIS_PROPERTIES": "anew"}
    while True:
        # --hypothesis-seed draws the same examples again; the profile does not fix them.
        words = ["-m", "pytest", "-q", "-x", "-m", "hypothesis", f"--hypothesis-seed={seed}"]
        print(f"fuzz: ADHESIS_PROPERTIES=anew python {' '.join(words)}", flush=True)
        if subprocess.run([sys.executable, *words], cwd=TOOLS.parent, env=anew).returncode != 0:
            return False
        if time.monotonic() > end:
            return True
        seed += 1


def main() -> int:
    """Run them one after another; returns 1 if one found something."""
    programs = {path.stem: path for path in sorted((TOOLS / "fuzz").glob("*.py"))}
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**32))
    parser.add_argument("--only", choices=[*programs, "properties"], help="one part")
    args = parser.parse_args()
    parts = [args.only] if args.only else [*programs, "properties"]
    share = args.seconds / len(parts)
    failed = []
    for name in parts:
        print(f"fuzz: {name}, seed {args.seed}, {share:.0f} s", flush=True)
        if name == "properties":
            found_nothing = properties(args.seed, share)
        else:
            drawn = ["--seed", str(args.seed), "--seconds", str(share)]
            words = [sys.executable, programs[name], *drawn]
            found_nothing = subprocess.run(words, check=False).returncode == 0
        if not found_nothing:
            failed.append(name)
    for name in failed:
        print(f"fuzz: {name} failed; again: python tools/fuzz.py --only {name} --seed {args.seed}")
    if not failed:
        print(f"fuzz: nothing found (seed {args.seed})")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
