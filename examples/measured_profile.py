"""From a measured trace to its loss, in Python: read, prepare, answer, page.

    python examples/measured_profile.py                  a measurement made up for the purpose
    python examples/measured_profile.py trace.csv        one of yours, units in its header

The same by the command line: adhesis trace FILE …. Why each step is needed, and what it does to the
loss: docs/measured-profile.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from adhesis import (
    HalfSpace,
    loss_of_trace,
    prepare_trace,
    read_trace,
    self_affine_profile,
)

MATERIAL = HalfSpace(young=1e6, poisson=0.5)  # a soft elastomer
WORK_OF_ADHESION = 0.04  # J/m²


def write_made_up_measurement(path: Path, seed: int = 7) -> None:
    """Write what a stylus might give: 2 mm in steps of 1 µm, in mm and µm, with gaps.

    A piece of a self-affine profile (H = 0.8, waves from 0.4 mm down to 10 µm, 1 µm rms) that is no
    period of it, on a sample tilted by 2 mrad and bent by 2 µm, with 5 nm of noise.
    """
    rng = np.random.default_rng(seed)
    rough = self_affine_profile(0.8, period=8e-3, n0=20, ratio=40, seed=seed, h_rms=1e-6)
    x = 1e-6 * np.arange(2001.0)
    z = rough.at(x) + 2e-3 * x + 2e-6 * (x / 1e-3 - 1) ** 2 + 5e-9 * rng.standard_normal(x.size)
    lines = [f"{1e3 * a:.3f};{1e6 * b:.4f}" for a, b in zip(x, z, strict=True)]
    for k in (333, 334, 1200):
        lines[k] = lines[k].split(";")[0] + ";"
    path.write_text("Position (mm);Height (µm)\n" + "\n".join(lines).replace(".", ",") + "\n")


def main() -> None:
    """Read, prepare, answer, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("trace", nargs="?", type=Path, help="text or instrument's file")
    parser.add_argument("--to", type=Path, default=Path("."), metavar="DIR", help="for the files")
    args = parser.parse_args()
    args.to.mkdir(parents=True, exist_ok=True)
    if args.trace is None:
        args.trace = args.to / "trace.csv"
        write_made_up_measurement(args.trace)

    trace = read_trace(args.trace)
    prepared = prepare_trace(trace)
    for step in prepared.steps:
        print(f"{step.name:<11} {step.description}")
    answer = loss_of_trace(prepared, half_space=MATERIAL, work_of_adhesion=WORK_OF_ADHESION)
    answer.page(args.to)
    print(answer)


if __name__ == "__main__":
    main()
