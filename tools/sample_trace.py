"""Make ``ensemble/command/sample.csv``, the trace that ``adhesis sample`` writes.

    python tools/sample_trace.py

A part of a self-affine profile, as a stylus would measure it: with tilt, bow, noise, drop-outs and
a speck of dust. The numbers are rounded so far that every machine writes the same file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adhesis import self_affine_profile

PLACE = Path(__file__).resolve().parent.parent / "adhesis" / "ensemble" / "command" / "sample.csv"
POINTS, STEP = 1001, 1e-6  # m


def text() -> str:
    """Return the file."""
    x = STEP * np.arange(POINTS)
    rough = self_affine_profile(0.8, period=2e-3, n0=8, ratio=12, seed=7, h_rms=0.4e-6)
    heights = rough.at(x) + 2e-3 * x + 1.5e-6 * (2 * x / x[-1] - 1) ** 2
    heights += 4e-9 * np.random.default_rng(7).standard_normal(POINTS)
    heights[640] += 3e-6  # dust
    rows = [f"{1e6 * a:.1f},{1e6 * h:.4f}" for a, h in zip(x, heights, strict=True)]
    for missing in (211, 212, 213, 808):
        rows[missing] = rows[missing].partition(",")[0] + ","
    head = "# synthetic stylus trace; adhesis sample\nposition (um),height (um)\n"
    return head + "\n".join(rows) + "\n"


if __name__ == "__main__":
    PLACE.write_text(text())
