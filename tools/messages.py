"""Count how often an error sentence reaches the terminal under mpirun: it must be once in each run.

    python tools/messages.py --runs 200 [--busy] [--case "unknown option"]

Runs commands with bad input on three ranks and prints, for each, how many runs gave the sentence
exactly once with exit code 2. ``--busy`` keeps every core busy meanwhile. Exit code 1 if a run
differs.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from adhesis.ensemble.run.launch import cores, launch_environment, launcher

RANKS = 3
BAD_CAMPAIGN = "[profile]\nspeed = 3\n"
# The words after adhesis, and the sentence expected on stderr.
CASES = {
    "unknown option": (("run", "c.toml", "--speed", "3"), "unrecognized arguments: --speed"),
    "unknown command": (("speed",), "COMMAND is 'speed'"),
    "bad key": (("run", "c.toml"), "speed is unknown"),
    "missing file": (("run", "none.toml"), "none.toml"),
    "bad value": (("run", "c.toml", "--redo", "some"), "speed is unknown"),
    "another command": (("status", "none.h5"), "none.h5"),
}


def run(folder: Path, words: tuple[str, ...], sentence: str) -> tuple[int, int]:
    """Return how many lines hold the sentence, and the exit code."""
    done = subprocess.run(
        [str(launcher()), "-n", str(RANKS), sys.executable, "-m", "adhesis", *words],
        cwd=folder,
        env=launch_environment(RANKS) | {"PYTHONPATH": str(Path(__file__).parents[1])},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
    )
    return sum(sentence in line for line in done.stderr.splitlines()), done.returncode


def main() -> int:
    """Run and count."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--case", action="append", choices=list(CASES))
    parser.add_argument("--busy", action="store_true")
    args = parser.parse_args()
    burn = [sys.executable, "-c", "while True: pass"]
    burners = [subprocess.Popen(burn) for _ in range(cores() if args.busy else 0)]
    wrong = 0
    try:
        with tempfile.TemporaryDirectory() as name:
            Path(name, "c.toml").write_text(BAD_CAMPAIGN)
            for case in args.case or CASES:
                seen = Counter(run(Path(name), *CASES[case]) for _ in range(args.runs))
                good = seen.pop((1, 2), 0)
                wrong += args.runs - good
                others = [f"{n} × ({m} times, exit code {c})" for (m, c), n in seen.items()]
                load = f"load {os.getloadavg()[0]:.1f}"
                print(f"{case}: {good} of {args.runs} as expected", *others, load, sep=", ")
                sys.stdout.flush()
    finally:
        for burner in burners:
            burner.kill()
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
