"""The property tests of the suite with new examples, round after round, each from its own seed."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent


def main() -> int:
    """Return 1 as soon as a round fails; at least one round is run."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    args = parser.parse_args()
    end = time.monotonic() + args.seconds
    for seed in range(args.seed, args.seed + 10**9):
        # --hypothesis-seed draws the same examples again; the profile does not fix them.
        words = ["-m", "pytest", "-q", "-x", "-m", "hypothesis", f"--hypothesis-seed={seed}"]
        done = subprocess.run(
            [sys.executable, *words, "-p", "no:cacheprovider"],
            cwd=ROOT,
            env=os.environ | {"ADHESIS_PROPERTIES": "anew"},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            print(done.stdout + done.stderr)
            print(f"again: ADHESIS_PROPERTIES=anew python {' '.join(words)}")
            return 1
        print(f"fuzz: properties, seed {seed}: {done.stdout.splitlines()[-1]}", flush=True)
        if time.monotonic() > end:
            return 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
