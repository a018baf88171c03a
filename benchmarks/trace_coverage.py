"""Whether the interval that `adhesis trace` states holds the loss that is known.

    python benchmarks/trace_coverage.py --cases 20 --json out/coverage.json

Each case is a self-affine profile whose loss is computed as it is. One period of it, begun
anywhere, is then measured: 2000 points, tilt, bow, white noise, drop-outs, now and then a spike;
written as a file of one kind after the other, read, prepared and answered as a user would.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from adhesis.ensemble.trace.answer import QUANTITIES, loss_of_trace
from adhesis.ensemble.trace.prepare import prepare_trace
from adhesis.ensemble.trace.reading.measured_trace import read_trace
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Profile, self_affine_profile
from adhesis.solver.registry import make_method
from tests.support import instrument_files

Array = NDArray[np.float64]

HALF_SPACE = HalfSpace(young=1e6, poisson=0.5)
WORK_OF_ADHESION, MAX_PENETRATION = 0.04, 0.9
LENGTH, POINTS = 2e-3, 2000


@dataclass(frozen=True, eq=False)
class Case:
    """A profile, and what an instrument makes of it."""

    number: int
    hurst: float
    profile: Profile
    heights: Array

    @property
    def step(self) -> float:
        """Of the measurement, in m."""
        return LENGTH / POINTS


def case(number: int, waves: int) -> Case:
    """Profile and measurement of a number: the same every time."""
    rng = np.random.default_rng([2, number])
    hurst = float(rng.uniform(0.6, 0.9))
    n0 = int(rng.integers(4, 11))
    profile = self_affine_profile(
        hurst, period=LENGTH, n0=n0, ratio=waves // n0, seed=1000 + number, h_rms=1e-6
    )
    x = LENGTH / POINTS * np.arange(POINTS)
    place = x / LENGTH - 0.5
    heights = profile.at(x + rng.uniform() * LENGTH)
    heights = heights + rng.normal() * 2e-3 * x  # tilt, some mrad
    heights = heights + rng.uniform(0, 3e-6) * (2 * place) ** 2  # bow, up to 3 µm
    heights = heights + rng.uniform(1e-9, 1e-8) * rng.standard_normal(POINTS)
    if number % 3 == 0:
        heights[rng.integers(50, POINTS - 50)] += 20e-6  # dust
    for first in rng.integers(20, POINTS - 20, 12):
        heights[first : first + rng.integers(1, 5)] = np.nan
    return Case(number, hurst, profile, heights)


def written(measured: Case, folder: Path) -> tuple[Path, dict[str, Any]]:
    """Write a case as one kind of file; the kinds take turns."""
    x, z = measured.step * np.arange(POINTS), measured.heights
    kinds = ("semicolons", "csv", "dat", "sdf", "qep", "sur")
    kind = kinds[measured.number % len(kinds)]
    path = folder / f"case{measured.number}.{kind}"
    if kind == "semicolons":
        path = path.with_suffix(".csv")
        rows = [
            f"{a * 1e3:.6f};{'' if np.isnan(b) else f'{b * 1e6:.6f}'}"
            for a, b in zip(x, z, strict=True)
        ]
        text = "Profile 1;;\nPosition (mm);Height (µm)\n" + "\n".join(rows)
        path.write_text(text.replace(".", ","), encoding="latin-1")
        return path, {}
    if kind == "csv":
        np.savetxt(path, np.column_stack([1e6 * x, 1e6 * z]), delimiter=",", fmt="%.6f")
        return path, {"unit": "um"}
    if kind == "dat":
        gaps = np.where(np.isnan(z), -9999.0, 1e9 * z)
        np.savetxt(path, gaps, fmt="%.3f", header=f"dx = {measured.step * 1e6:g} um\nz (nm)")
        return path, {}
    writer = {
        "sdf": instrument_files.sdf,
        "qep": instrument_files.mahr,
        "sur": instrument_files.sur,
    }
    if kind == "qep":
        instrument_files.mahr(path, measured.step, z, tip_radius=1e-6)
    else:
        writer[kind](path, measured.step, z)
    return path, {}


def known(profile: Profile) -> dict[str, float]:
    """Loss, pull-off and largest contact of the profile as it is."""
    method = make_method("auto", Problem(profile, HALF_SPACE, WORK_OF_ADHESION))
    loop = run_loop(method, max_penetration=MAX_PENETRATION, load_steps=40)
    values = (loop.loss, loop.pull_off_stress, float(loop.contact_fraction.max()))
    return dict(zip(QUANTITIES, values, strict=True))


def judged(measured: Case, folder: Path, processes: int = 0) -> dict[str, Any]:
    """Known and stated values of one case."""
    path, options = written(measured, folder)
    prepared = prepare_trace(read_trace(path, **options))
    answer = loss_of_trace(
        prepared,
        half_space=HALF_SPACE,
        work_of_adhesion=WORK_OF_ADHESION,
        max_penetration=MAX_PENETRATION,
        quick=True,
        processes=processes,
    )
    row: dict[str, Any] = {
        "case": measured.number,
        "file": path.suffix,
        "hurst": measured.hurst,
        "degree": prepared.degree,
        "cut_off": prepared.cut_off,
        "outliers": sum(s.numbers["points"] for s in prepared.steps if s.name == "outliers"),
        "seconds": answer.seconds,
        "losses": {
            run.name: found["loss"]
            for run in answer.plan.runs
            if (found := answer.result(run.name)) is not None
        },
    }
    for name, value in known(measured.profile).items():
        stated = getattr(answer, name)
        row[name] = {
            "known": value,
            "stated": stated.value,
            "uncertainty": stated.uncertainty,
            "covered": abs(stated.value - value) <= stated.uncertainty,
            "doubts": stated.doubts,
        }
    return row


def main() -> None:
    """Run the cases, print a line each and the count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--waves", type=int, default=100, help="most waves a period")
    parser.add_argument("--processes", type=int, default=0)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    rows = []
    print("case file   H    degree cut-off   known      stated        off   within")
    with tempfile.TemporaryDirectory() as folder:
        for number in range(args.first, args.first + args.cases):
            row = judged(case(number, args.waves), Path(folder), args.processes)
            rows.append(row)
            loss = row["loss"]
            off = loss["stated"] / loss["known"] - 1
            print(
                f"{number:4d} {row['file']:5} {row['hurst']:.2f} {row['degree']:5d} "
                f"{1e6 * row['cut_off']:7.2f}  {1e3 * loss['known']:6.1f}  "
                f"{1e3 * loss['stated']:6.1f} ± {1e3 * loss['uncertainty']:4.1f}  {off:+6.1%}   "
                f"{'yes' if loss['covered'] else 'NO'}",
                flush=True,
            )
    for name in QUANTITIES:
        held = sum(row[name]["covered"] for row in rows)
        width = np.mean([row[name]["uncertainty"] / row[name]["stated"] for row in rows])
        off = [row[name]["stated"] / row[name]["known"] - 1 for row in rows]
        print(
            f"{name}: {held} of {len(rows)} within the interval, ± {width:.0%} on average; "
            f"off by {np.mean(off):+.1%} on average, {np.sqrt(np.mean(np.square(off))):.1%} rms"
        )
    print("loss of one way of closing the period, off the known one:")
    for way in ("answer", "blend 10 %", "taper 5 %", "taper 10 %"):
        off = [r["losses"][way] / r["loss"]["known"] - 1 for r in rows if way in r["losses"]]
        print(f"{way:<11} {np.mean(off):+.1%} ± {np.std(off, ddof=1):.1%}")
    if args.json is not None:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        args.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
