"""Draws two_scales.png: where a rough contact loses energy, in patches and inside of them.

Run it as ``.venv/bin/python docs/figures/two_scales.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from adhesis import (
    ContactState,
    HalfSpace,
    LoopResult,
    Problem,
    make_method,
    run_loop,
    self_affine_profile,
)

LOADING, UNLOADING = "#1f5fa8", "#c4472b"
BODY, RIGID = "#dbe4ee", "#8a8f98"
SMALL = ("receding", "spreading")


def compute() -> LoopResult:
    """Compute a loop of three crests, with roughness on each."""
    profile = self_affine_profile(0.75, period=1e-3, n0=2, ratio=50, seed=11, h_rms=1e-6)
    problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), work_of_adhesion=0.006)
    return run_loop(make_method("sharp", problem), max_penetration=0.7, load_steps=60)


def draw_map(axes: Axes, loop: LoopResult, branch: str, colour: str) -> None:
    """Draw where there is contact, against the penetration."""
    rows = loop.states(branch)
    period = loop.problem.profile.period
    places = loop.penetration[rows]
    for k, row in enumerate(rows[:-1]):
        state = loop.contact_states[row]
        low, high = sorted((places[k], places[k + 1]))
        if high == low:
            continue
        for left, right in state.edges:
            for turn in (0.0, -period):
                axes.fill_between(
                    [1e3 * (left + turn), 1e3 * (right + turn)], low, high, color=colour, lw=0
                )
    drops = [jump for jump in loop.jumps if jump.branch == branch]
    for jump in drops:
        axes.plot(
            1.02e3 * period,
            loop.problem.penetration(jump.separation),
            marker="<" if jump.kind in SMALL else "o",
            ms=1.5 + 9 * np.sqrt(jump.energy_drop / loop.loss),
            color="#2f8f5b" if jump.kind in SMALL else "k",
            mew=0,
            clip_on=False,
            alpha=0.8,
        )
    axes.set(xlim=(0, 1e3 * period), ylabel="penetration $\\Delta/h_{max}$")
    axes.set_title(f"contact on {branch}", fontsize=10)


def draw_jump(axes: Axes, loop: LoopResult, number: int, title: str) -> None:
    """Draw the bodies before and after a jump."""
    jump = loop.jumps[number]
    place = loop.states_before_jumps()[number]
    before, after = loop.contact_states[place], loop.contact_states[place + 1]
    method = loop.new_method()
    period = loop.problem.profile.period
    left, right = changed(before, after, period)
    width = max(right - left, 0.06 * period)
    x = np.linspace(left - 0.7 * width, right + 0.7 * width, 1600)
    height = loop.problem.profile.at(x)
    old, new = (surface_of(method, state, x) for state in (before, after))
    low, high = height.min(), max(old.max(), new.max())
    room = 0.25 * (high - low)
    axes.fill_between(1e3 * x, 1e6 * new, 1e6 * (high + room), color=BODY, lw=0)
    axes.plot(1e3 * x, 1e6 * old, color=UNLOADING, lw=1.1, ls="--", label="before")
    axes.plot(1e3 * x, 1e6 * new, color="#51667d", lw=1.3, label="after")
    axes.fill_between(1e3 * x, 1e6 * (low - room), 1e6 * height, color=RIGID, lw=0)
    axes.set(
        xlim=(1e3 * x[0], 1e3 * x[-1]),
        ylim=(1e6 * (low - 0.6 * room), 1e6 * (high + room)),
        xlabel="position (mm)",
        ylabel="height (µm)",
    )
    axes.set_title(
        f"{title}: {jump.kind} at {loop.problem.penetration(jump.separation):.2f}, "
        f"{1e3 * jump.energy_drop:.3f} mJ/m²",
        fontsize=10,
    )
    axes.legend(fontsize=8, loc="upper right", framealpha=0.9, edgecolor="none")


def changed(before: ContactState, after: ContactState, period: float) -> tuple[float, float]:
    """Return the ends of the longest stretch whose contact a jump changes."""
    x = np.linspace(0, period, 20001)
    differs = np.diff((covered(before, x, period) != covered(after, x, period)).astype(int))
    starts, ends = np.flatnonzero(differs > 0), np.flatnonzero(differs < 0)
    longest = int(np.argmax(ends - starts))
    return float(x[starts[longest]]), float(x[ends[longest]])


def covered(state: ContactState, x: np.ndarray, period: float) -> np.ndarray:
    """Return whether each position is in contact."""
    inside = np.zeros(x.size, bool)
    for left, right in state.edges:
        for turn in (0.0, period):
            inside |= (x + turn >= left) & (x + turn <= right)
    return inside


def surface_of(method: object, state: ContactState, x: np.ndarray) -> np.ndarray:
    """Return the height of the deformed surface above the profile's mean line."""
    problem = method.problem
    if not state.patches:
        return np.full(x.size, state.separation)
    gap = np.zeros(x.size)
    for opening in method.openings(state):
        for turn in (-problem.profile.period, 0.0, problem.profile.period):
            inside = (x + turn > opening.x[0]) & (x + turn < opening.x[-1])
            gap[inside] = np.interp(x[inside] + turn, opening.x, opening.gap)
    return problem.profile.at(x) + gap


def main() -> None:
    """Draw the figure."""
    path = Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("two_scales.png")
    loop = compute()
    figure, panels = plt.subplot_mosaic(
        [["up", "down"], ["profile", "profile2"], ["small", "large"]],
        height_ratios=[2.2, 0.5, 1.7],
        figsize=(9, 6.4),
        layout="constrained",
    )
    draw_map(panels["up"], loop, "loading", LOADING)
    draw_map(panels["down"], loop, "unloading", UNLOADING)
    lowest = min(loop.problem.penetration(jump.separation) for jump in loop.jumps)
    x = np.linspace(0, loop.problem.profile.period, 2000)
    for name, above in (("profile", "up"), ("profile2", "down")):
        panels[above].set_ylim(1.08 * lowest, 0.72)
        panels[above].axhline(0, color="0.6", lw=0.6)
        panels[above].tick_params(labelbottom=False)
        panels[name].fill_between(1e3 * x, -4, 1e6 * loop.problem.profile.at(x), color=RIGID, lw=0)
        panels[name].set(
            xlim=(0, 1e3 * x[-1]), ylim=(-3, 3), yticks=[], xlabel="position (mm)", ylabel="h(x)"
        )
    kinds = [
        Line2D([], [], color="#2f8f5b", marker="<", ls="", label="small-scale jump"),
        Line2D([], [], color="k", marker="o", ls="", label="large-scale jump"),
    ]
    panels["up"].legend(handles=kinds, frameon=False, fontsize=8, loc="lower left")
    numbers = range(len(loop.jumps))
    unloading = [k for k in numbers if loop.jumps[k].branch == "unloading"]
    small = max(
        (k for k in unloading if loop.jumps[k].kind == "receding"),
        key=lambda k: loop.jumps[k].energy_drop,
    )
    large = max(
        (k for k in unloading if loop.jumps[k].kind in ("vanishing", "pull-off")),
        key=lambda k: loop.jumps[k].energy_drop,
    )
    draw_jump(panels["small"], loop, small, "small scale")
    draw_jump(panels["large"], loop, large, "large scale")
    figure.savefig(path, dpi=160)
    share = sum(j.energy_drop for j in loop.jumps if j.kind in SMALL) / loop.loss_from_drops
    print(f"{len(loop.jumps)} jumps, loss {1e3 * loop.loss:.3f} mJ/m², small scale {share:.1%}")


if __name__ == "__main__":
    main()
