"""Draws zero_range.png: below which range of adhesion a loop is of zero range, for any material.

Run it as ``.venv/bin/python docs/figures/zero_range.py``. With one shape of spectrum σ_in over
E* h', h' the rms slope, depends on γ/(E* λ_min h'²) alone. So loops of one profile with several E
give the range for every E, slope, γ and λ_min.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import NullFormatter

from adhesis import HalfSpace, LoopResult, Problem, make_method, run_loop, self_affine_profile

GAMMA = 0.04
PAPER = {"period": 2e-3 * np.pi, "n0": 10, "ratio": 100}
NARROW = {"period": 2e-3, "n0": 2, "ratio": 25}
SEEDS = (0, 1, 2)
MODULI = 10.0 ** np.arange(5.0, 12.1, 0.5)  # E in Pa
RANGES = (0.1e-9, 1e-9, 10e-9, 100e-9, 1e-6)


def loop_of(young: float, gamma: float, seed: int, **shape: float) -> LoopResult:
    """One loop to Δ/h_max = 0.9 of a profile of H = 0.8 and h_rms = 1 µm."""
    profile = self_affine_profile(0.8, seed=seed, h_rms=1e-6, **shape)
    problem = Problem(profile, HalfSpace(young, 0.5), gamma)
    return run_loop(make_method("sharp", problem), max_penetration=0.9, load_steps=40)


def groups(loop: LoopResult) -> tuple[float, float]:
    """γ/(E* λ_min h'²), and the range over γ/(E* h')."""
    problem, profile = loop.problem, loop.problem.profile
    gamma, modulus = problem.work_of_adhesion, problem.half_space.modulus
    slope = np.sqrt(profile.m2)
    return (
        gamma / (modulus * profile.shortest_wavelength * slope**2),
        loop.valid_range * modulus * slope / gamma,
    )


def draw(narrow: np.ndarray, paper: np.ndarray, path: Path) -> None:
    """Draw the curve in dimensionless groups, and the map of materials that follows from it.

    Parameters
    ----------
    narrow : array, shape (moduli, seeds, 2)
        :func:`groups` of the loops of the curve.
    paper : array, shape (loops, 2)
        Those of loops with the paper's spectrum.
    path : Path
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    group = np.exp(np.log(narrow[..., 0]).mean(axis=1))
    least = narrow[..., 1].min(axis=1)
    for k in range(narrow.shape[1]):
        name = "n0 = 2, N = 25" if k == 0 else None
        left.loglog(*narrow[:, k].T, "o", ms=3, color="#1f5fa8", label=name)
    left.loglog(group, least, color="#1f5fa8", lw=1, label="least of three profiles")
    left.loglog(*paper.T, "^", ms=6, color="#c4472b", label="the paper's spectrum")
    left.set(
        xlabel="γ / (E* λ_min h'²)",
        ylabel="valid_range · E* h' / γ",
        title="One curve for one shape of spectrum",
    )
    left.set_yticks([0.2, 0.5, 1, 2], ["0.2", "0.5", "1", "2"])
    left.yaxis.set_minor_formatter(NullFormatter())
    left.legend(frameon=False, fontsize=8)
    left.grid(alpha=0.3)

    wave = PAPER["period"] / (PAPER["n0"] * PAPER["ratio"])
    modulus, slope = np.geomspace(1e5, 1e12, 200)[:, None], np.geomspace(3e-3, 0.5, 200)
    place = np.log(GAMMA / (modulus * wave * slope**2))
    order = np.argsort(group)
    known = np.interp(place, np.log(group[order]), np.log(least[order]), np.nan, np.nan)
    found = np.exp(known) * GAMMA / (modulus * slope)
    right.contourf(
        modulus[:, 0], slope, found.T, [0, 1e-9, 1e-8, 1], colors=["#f3c6bb", "#fbeedd", "#e3ecf6"]
    )
    lines = right.contour(modulus[:, 0], slope, found.T, RANGES, colors="#333333", linewidths=1)
    names = {value: f"{1e9 * value:g} nm" for value in RANGES}
    profile = self_affine_profile(0.8, seed=1, h_rms=1e-6, **PAPER)
    right.plot(1e6 / 0.75, np.sqrt(profile.m2), "^", color="#c4472b", ms=8)
    right.annotate(
        "the paper", (1e6 / 0.75, np.sqrt(profile.m2)), (-24, 9), textcoords="offset points"
    )
    right.plot(2e11 / 0.91, np.sqrt(profile.m2), "s", color="#333333", ms=6)
    right.annotate(
        "steel", (2e11 / 0.91, np.sqrt(profile.m2)), (-36, 6), textcoords="offset points"
    )
    right.set(
        xscale="log",
        yscale="log",
        xlabel="E* (Pa)",
        ylabel="rms slope h'",
        title=f"valid_range at γ = {GAMMA:g} J/m², λ_min = {1e6 * wave:.2g} µm",
    )
    figure.canvas.draw()  # labels are placed along the lines as they are at last
    right.clabel(lines, fmt=names, fontsize=8)
    figure.savefig(path, dpi=160)


def main() -> None:
    """Compute the loops and draw."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("zero_range.png")
    narrow = np.array(
        [
            [groups(loop_of(young, GAMMA, seed, **NARROW)) for seed in SEEDS]
            for young in MODULI.tolist()
        ]
    )
    paper = np.array([groups(loop_of(1e6, gamma, 1, **PAPER)) for gamma in (0.01, 0.04, 0.07)])
    draw(narrow, paper, path)


if __name__ == "__main__":
    main()
