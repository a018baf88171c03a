"""Draws loop.png, the figure of the README: one loop, its jumps, and the audit of its loss.

Run it as ``.venv/bin/python docs/figures/loop.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

from adhesis import HalfSpace, Problem, make_method, run_loop, self_affine_profile
from adhesis.solver.loading.loop_result import LoopResult

COLOURS = {"loading": "#1f5fa8", "unloading": "#c4472b"}


def compute() -> LoopResult:
    """One rough profile, H = 0.8, the paper's material and γ = 0.04 J/m²."""
    profile = self_affine_profile(0.8, period=6.283185e-3, n0=4, ratio=50, seed=5, h_rms=1e-6)
    problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), work_of_adhesion=0.04)
    return run_loop(make_method("grid", problem), max_penetration=0.9, load_steps=40)


def draw(loop: LoopResult, path: Path) -> None:
    """Stress and contact fraction against penetration."""
    figure, panels = plt.subplot_mosaic(
        [["jumps", "contact"], ["stress", "contact"]],
        height_ratios=[1, 5],
        figsize=(9, 4),
        layout="constrained",
    )
    strip, left, right = panels["jumps"], panels["stress"], panels["contact"]
    for place, (branch, colour) in enumerate(COLOURS.items()):
        rows = loop.states(branch)
        x = loop.penetration[rows]
        left.plot(x, loop.mean_stress[rows] / 1e3, color=colour, lw=1.5, label=branch)
        right.plot(x, loop.contact_fraction[rows], color=colour, lw=1.5, label=branch)
        jumps = [jump for jump in loop.jumps if jump.branch == branch]
        strip.scatter(
            [loop.problem.penetration(jump.separation) for jump in jumps],
            [-place] * len(jumps),
            [600 * jump.energy_drop / loop.loss for jump in jumps],
            color=colour,
            alpha=0.5,
            lw=0,
        )
    strip.sharex(left)
    strip.set(ylim=(-1.8, 0.8), yticks=[])
    strip.tick_params(axis="x", bottom=False, labelbottom=False)
    strip.spines[:].set_visible(False)
    strip.set_title(
        f"{len(loop.jumps)} jumps (area: energy drop), together "
        f"{1e3 * loop.loss_from_drops:.3f} mJ/m²",
        fontsize=9,
    )
    left.axhline(0, color="0.6", lw=0.6)
    left.set(ylabel="mean stress $\\bar p$ (kPa)")
    left.set_title(f"loss $\\oint\\bar p\\,d\\Delta$ = {1e3 * loop.loss:.3f} mJ/m²", fontsize=9)
    right.set(ylabel="contact fraction $A/A_0$", ylim=(0, None))
    for axes in (left, right):
        axes.set_xlabel("penetration $\\Delta/h_{max}$")
        axes.legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    draw(compute(), Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("loop.png"))
