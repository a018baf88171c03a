"""Write a sample trace, as a stylus would measure it, to try ``adhesis trace`` with.

It is synthetic: 1 mm in steps of 1 µm, rough down to 20 µm, with tilt, bow, noise, dust, drop-outs.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from adhesis.ensemble.escape import shell_word
from adhesis.ensemble.files import write_new

EXAMPLES = ("adhesis sample trace.csv", "adhesis sample data/stylus.csv")
_POINTS, _STEP = 1001, 1e-6  # m


OPTIONS = (("file FILE", Path, "the file to write, as .csv"),)


def execute(args: argparse.Namespace) -> None:
    """Write the file."""
    write_new("FILE", args.file, lambda: _sample().encode())
    options = "--work-of-adhesion 0.04 --young 1e6 --poisson 0.5 --to out"
    print(f"next        adhesis trace {shell_word(args.file)} {options}")


def _sample() -> str:
    """Return the file: part of a self-affine profile, with tilt, bow, noise, drop-outs and dust.

    The numbers are rounded so far that every machine writes the same ones.
    """
    import numpy as np

    from adhesis.solver.model.profile import self_affine_profile

    x = _STEP * np.arange(_POINTS, dtype=np.float64)
    rough = self_affine_profile(0.8, period=2e-3, n0=8, ratio=12, seed=7, h_rms=0.4e-6)
    heights = rough.at(x) + 2e-3 * x + 1.5e-6 * (2 * x / x[-1] - 1) ** 2
    heights += 4e-9 * np.random.default_rng(7).standard_normal(_POINTS)
    heights[640] += 3e-6  # dust
    rows = [f"{1e6 * a:.1f},{1e6 * h:.4f}" for a, h in zip(x, heights, strict=True)]
    for missing in (211, 212, 213, 808):
        rows[missing] = rows[missing].partition(",")[0] + ","
    head = "# synthetic stylus trace; adhesis sample\nposition (um),height (um)\n"
    return head + "\n".join(rows) + "\n"
