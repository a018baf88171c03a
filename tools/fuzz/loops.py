"""Hostile loops: random scenes far from the ordinary, each followed under a time limit and judged.

A scene is drawn from the seed and its number alone; what repeats one is printed. Judged is that the
loop ends in time and without a crash; that stresses, energies and losses are finite, drops are not
negative, and states come in order; that surfaces nowhere overlap (by an independent solution of
the field) and contact is not lost below s = h_max; that loop integral and sum of drops agree within
``loss_error``; for every fourth scene that a run to 1e-5, or a hundred times as accurate, agrees
within both errors, where nothing raced; and for every twentieth that ``grid`` does. A path that is
refused (PathError) is counted.

    python tools/fuzz/loops.py --seed N [--scenes 2000] [--number K] [--law LAW] [--control C]
        [--decades D]

The law of adhesion is one γ, two works (open), γ(x) (pattern) or a range; loops of ``--law many``
have one γ and 20 to 80 patches, and all are compared: half a minute each. Of the ranges half are up
to four decades above that below which no patch would open from inside, the others up to
``edge_range``. Then no state may have a gap that should have touched, and none a tension inside a
patch that exceeds the strength by more than a hundredth, unless the loop's warnings state it.
"""

import argparse
import os
import sys
import time
from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

import numpy as np

from tools.hostile import CONTROLS, LAWS, MOST_DECADES, draw, judge
from tools.isolated import Isolated

LIMIT = 120.0  # s of CPU time of one scene, all its runs together
_QUANTILES = (0.1, 0.5, 0.9, 0.99)  # of the differences over loss_error that are printed


def judged(seed: int, number: int, law: str, control: str, decades: float) -> dict[str, Any]:
    """Draw a scene and judge it."""
    return judge(draw(seed, number, law, control, decades), number)


def calibration(found: list[dict[str, Any]]) -> str:
    """Compare ``loss_error`` with the differences from far more accurate runs."""
    compared = [f for f in found if f["kind"] == "tight" and "off" in f]
    calm = [f for f in compared if not f["raced"]]
    if not calm:
        return "loss_error: nothing to compare"
    ratio = np.array([f["off"] / f["loss_error"] for f in calm])
    shares = ", ".join(f"{np.quantile(ratio, q):.2f} ({100 * q:g} %)" for q in _QUANTILES)
    return (
        f"difference from far more accurate runs over loss_error: below 1 in {np.sum(ratio < 1)} "
        f"of {len(calm)} loops, largest {ratio.max():.2f}; quantiles {shares}; "
        f"{len(compared) - len(calm)} loops with races left out"
    )


def range_summary(found: list[dict[str, Any]]) -> str:
    """State by how much the tension inside patches exceeds the strength, and what did not hold."""
    excess = np.array([f.get("excess", 0.0) for f in found])
    return (
        f"the tension inside patches exceeds the strength by 1 % in {np.sum(excess > 1.01)} loops, "
        f"at most {excess.max():.3g} times; "
        f"{sum(f.get('flagged', False) for f in found)} losses are doubtful for it; "
        f"{sum(f.get('not held', 0) for f in found)} touches did not hold at first"
    )


def main() -> int:
    """Return 1 if a scene came out wrong."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--seconds", type=float, default=np.inf)
    parser.add_argument("--scenes", type=int, default=2000, help="at most so many")
    parser.add_argument("--number", type=int, help="this scene alone")
    parser.add_argument("--law", choices=LAWS, default="one")
    parser.add_argument("--control", choices=CONTROLS, default="separation")
    parser.add_argument("--decades", type=float, default=MOST_DECADES, help="of γ_open/γ - 1")
    args = parser.parse_args()
    if args.number is not None:
        alone = draw(args.seed, args.number, args.law, args.control, args.decades)
        print(alone)
        one = judge(alone, args.number)
        print(one)
        return int(bool(one["wrong"]))
    end, shown = time.monotonic() + args.seconds, time.monotonic()
    everything: list[dict[str, Any]] = []
    kinds: Counter[str] = Counter()
    failures = races = 0
    with closing(Isolated(judged, LIMIT)) as isolated:
        for number in range(args.scenes):
            if time.monotonic() > end and everything:
                break
            scene = args.seed, number, args.law, args.control, args.decades
            found, ended = isolated(*scene)
            found = found or {"wrong": [ended], "kind": "ended"}
            everything.append(found)
            kinds[found["kind"]] += 1
            races += bool(found.get("races"))
            if found["wrong"]:
                failures += 1
                again = f"python tools/fuzz/loops.py --seed {args.seed} --number {number}"
                again += f" --law {args.law} --control {args.control}"
                again += f" --decades {args.decades!r}"
                print(f"{'; '.join(found['wrong'])}\n    {again}")
            if time.monotonic() - shown > 14:
                shown = time.monotonic()
                count = len(everything)
                print(f"fuzz: {count} loops, {failures} wrong, {races} with races", flush=True)
    if args.law == "range":
        print(f"fuzz: {range_summary(everything)}")
    seconds = sum(found.get("seconds", 0.0) for found in everything)
    print(
        f"fuzz: {len(everything)} loops in {seconds:.0f} s of CPU time, {failures} wrong, "
        f"{races} with races; {dict(kinds)}"
    )
    print(f"fuzz: {calibration(everything)}")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
