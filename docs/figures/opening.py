"""Draws opening.png: the loss against E of zero range, and of a range that is given.

Run it as ``.venv/bin/python docs/figures/opening.py [FILE [PROFILES]]``; it prints the table of
docs/zero-range.md. The range of adhesion is 0.3 nm, and three profiles are taken by default.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from adhesis import (
    HalfSpace,
    LoopResult,
    PathError,
    Problem,
    make_method,
    run_loop,
    self_affine_profile,
)

GAMMA, RANGE = 0.04, 0.3e-9
NARROW = {"period": 2e-3, "n0": 2, "ratio": 25}
MODULI = (1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 2e11, 1e12)  # E in Pa
GAMMAS = (0.04, 0.02, 0.01)  # J/m², of steel


def loop_of(young: float, seed: int, adhesion_range: float | None, gamma: float) -> LoopResult:
    """One loop to Δ/h_max = 0.9 of a profile of H = 0.8 and h_rms = 1 µm."""
    profile = self_affine_profile(0.8, seed=seed, h_rms=1e-6, **NARROW)
    problem = Problem(profile, HalfSpace(young, 0.5), gamma, adhesion_range=adhesion_range)
    method = make_method("sharp", problem, accuracy=1e-2)  # far below the scatter of profiles
    return run_loop(method, max_penetration=0.9, load_steps=20)


def pair_of(young: float, seed: int, gamma: float) -> tuple[LoopResult, LoopResult] | None:
    """Loops of zero range and of a finite one; None if the path of one is not found."""
    try:
        return loop_of(young, seed, None, gamma), loop_of(young, seed, RANGE, gamma)
    except PathError as error:
        print(f"E = {young:g} Pa, profile {seed}: {error}", file=sys.stderr, flush=True)
        return None


def row_of(young: float, seeds: range, gamma: float) -> tuple[float, ...]:
    """Mean losses of zero and finite range, openings a loop, barriers over loss, and profiles."""
    pairs = [pair for seed in seeds if (pair := pair_of(young, seed, gamma)) is not None]
    zero = np.mean([pair[0].loss for pair in pairs])
    finite = np.mean([pair[1].loss for pair in pairs])
    openings = np.mean([pair[1].openings for pair in pairs])
    barriers = np.mean([pair[1].barrier for pair in pairs])
    return float(zero), float(finite), float(openings), float(barriers / finite), len(pairs)


def main() -> None:
    """Compute the loops, print the table and draw."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("opening.png")
    seeds = range(int(sys.argv[2]) if len(sys.argv) > 2 else 3)
    rows = []
    head = ("E (Pa)", "γ (J/m²)", "zero range", "range 0.3 nm", "openings", "barriers over loss")
    print(f"| {' | '.join((*head, 'profiles'))} |\n|{'---|' * (len(head) + 1)}")
    scenes = [(young, GAMMA) for young in MODULI] + [(2e11, gamma) for gamma in GAMMAS[1:]]
    for young, gamma in scenes:
        row = row_of(young, seeds, gamma)
        rows.append(row)
        text = " | ".join(f"{value:.3g}" for value in row)
        print(f"| {young:.0e} | {gamma:g} | {text} |", flush=True)
    table = np.array(rows)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    count = len(MODULI)
    left.loglog(MODULI, table[:count, 0] / GAMMA, "o-", color="#c4472b", label="zero range")
    left.loglog(MODULI, table[:count, 1] / GAMMA, "s-", color="#1f5fa8", label="range 0.3 nm")
    left.set(xlabel="E (Pa)", ylabel="loss/γ", title=f"γ = {GAMMA:g} J/m²")
    steel = [MODULI.index(2e11), *range(count, len(scenes))]
    right.loglog(GAMMAS, table[steel, 0], "o-", color="#c4472b", label="zero range")
    right.loglog(GAMMAS, table[steel, 1], "s-", color="#1f5fa8", label="range 0.3 nm")
    right.set(xlabel="γ (J/m²)", ylabel="loss (J/m²)", title="steel, E = 200 GPa")
    for axes in (left, right):
        axes.legend(frameon=False, fontsize=8)
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=160)


if __name__ == "__main__":
    main()
