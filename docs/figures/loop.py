"""Draws loop.png, the figure of the README: one loop, its jumps, and the contact at three points.

Run it as ``.venv/bin/python docs/figures/loop.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from adhesis import HalfSpace, LoopResult, Problem, make_method, run_loop, self_affine_profile
from adhesis.ensemble.loop.film import Film, Scene
from adhesis.ensemble.report.figures.style import LINE_OF_BRANCH, MM, TWO_COLUMNS, style

COLOURS = {"loading": "#0072B2", "unloading": "#D55E00"}
BODY, RIGID, CONTACT = "#BFDDF0", "0.6", "#D55E00"
# Points of the loop whose contact is drawn: branch and Δ/h_max.
POINTS = {"a": ("loading", 0.5), "b": ("unloading", 0.9), "c": ("unloading", -1.1)}
_AREA = 500  # of a marker, in points², whose jump loses all
_JUMPS_AT = {"loading": 0.87, "unloading": 0.95}  # heights in the panel of the stress


def compute() -> LoopResult:
    """One rough profile, H = 0.8, the paper's material and γ = 0.04 J/m²."""
    profile = self_affine_profile(0.8, period=6.283185e-3, n0=10, ratio=30, seed=1, h_rms=1e-6)
    problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), work_of_adhesion=0.04)
    return run_loop(make_method("auto", problem), max_penetration=0.9, load_steps=40)


def scene_at(film: Film, loop: LoopResult, branch: str, penetration: float) -> Scene:
    """Return the scene of a branch that is nearest to a penetration."""
    of_branch = [scene for scene in film.scenes if loop.branch[scene.state] == branch]
    return min(of_branch, key=lambda s: abs(loop.penetration[s.state] - penetration))


def draw_curves(stress: Axes, contact: Axes, loop: LoopResult, points: dict[str, Scene]) -> None:
    """Draw stress and contact fraction against penetration, jumps as discs, points by letters."""
    for branch, colour in COLOURS.items():
        rows = loop.states(branch)
        options: Any = {"color": colour, "ls": LINE_OF_BRANCH[branch]}
        stress.plot(loop.penetration[rows], loop.mean_stress[rows] / 1e3, **options)
        contact.plot(loop.penetration[rows], loop.contact_fraction[rows], **options)
        jumps = [jump for jump in loop.jumps if jump.branch == branch]
        stress.scatter(
            [loop.problem.penetration(jump.separation) for jump in jumps],
            [_JUMPS_AT[branch]] * len(jumps),
            [_AREA * jump.energy_drop / loop.loss for jump in jumps],
            color=colour,
            alpha=0.55,
            lw=0,
            transform=stress.get_xaxis_transform(),
        )
    stress.axhline(0, color="0.6", lw=0.6)
    for name, scene in points.items():
        for axes, values in ((stress, loop.mean_stress / 1e3), (contact, loop.contact_fraction)):
            place = loop.penetration[scene.state], values[scene.state]
            axes.plot(*place, "o", ms=9, mfc="white", mec="black", mew=0.7, zorder=4)
            axes.annotate(name, place, ha="center", va="center_baseline", fontsize=7, zorder=5)
    low = 1.06e-3 * float(loop.mean_stress.min())
    high = max(1e-3 * float(loop.mean_stress.max()), 0.0)
    # The jumps take the upper part, without numbers.
    stress.set_ylim(low, high + 0.25 * (high - low))
    stress.set_yticks([tick for tick in stress.get_yticks() if low <= tick <= high])
    stress.set_ylabel("mean stress $\\bar p$ (kPa)")
    contact.set(ylabel="contact fraction $A/A_0$", ylim=(0, 1))
    for axes in (stress, contact):
        axes.set_xlabel("penetration $\\Delta/h_\\mathrm{max}$")
    stress.set_title(
        f"loss $\\oint\\bar p\\,d\\Delta$ = {1e3 * loop.loss:.3f} mJ/m²; "
        f"{len(loop.jumps)} jumps lose {1e3 * loop.loss_from_drops:.3f} mJ/m²",
        loc="left",
    )


def draw_contact(axes: Axes, film: Film, scene: Scene, top: float) -> None:
    """Draw the elastic body over the rigid profile."""
    x, height, surface = 1e3 * film.x, 1e6 * film.height, 1e6 * scene.surface
    axes.fill_between(x, height, height.min() - 0.5, color=RIGID, lw=0)
    axes.fill_between(x, surface, top, color=BODY, lw=0)
    axes.plot(x, surface, color=COLOURS["loading"], lw=0.8)
    for left, right in 1e3 * scene.patches:
        inside = (x >= left) & (x <= right)
        axes.plot(x[inside], surface[inside], color=CONTACT, lw=1.6)
    axes.grid(visible=False)
    axes.set(xlim=(x[0], x[-1]), ylim=(height.min() - 0.5, top), xlabel="position (mm)")


def draw(loop: LoopResult, path: Path) -> None:
    """Draw stress and contact fraction above, the three contacts below."""
    film = Film(loop, 200)
    points = {name: scene_at(film, loop, *point) for name, point in POINTS.items()}
    top = 1e6 * max(float(scene.surface.max()) for scene in points.values()) + 1.5
    with style():
        figure = plt.figure(figsize=(TWO_COLUMNS, 108 * MM))
        grid = figure.add_gridspec(2, 6, height_ratios=[3, 2])
        stress, contact = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3:])
        draw_curves(stress, contact, loop, points)
        first: Axes | None = None
        for k, (name, scene) in enumerate(points.items()):
            axes = figure.add_subplot(grid[1, 2 * k : 2 * k + 2], sharey=first)
            draw_contact(axes, film, scene, top)
            depth = loop.penetration[scene.state]
            patches = len(loop.contact_states[scene.state].edges)
            several = "patch" if patches == 1 else "patches"
            axes.set_title(
                f"{name}: $\\Delta/h_\\mathrm{{max}} = {depth:.2f}$, {patches} {several}",
                loc="left",
            )
            if first is None:
                first = axes
                axes.set_ylabel("height (µm)")
            else:
                axes.tick_params(labelleft=False)
        handles = [
            *(Line2D([], [], color=c, ls=LINE_OF_BRANCH[b], label=b) for b, c in COLOURS.items()),
            Line2D([], [], marker="o", ls="none", color="0.5", label="jump, area: energy drop"),
            Patch(color=BODY, label="elastic body"),
            Patch(color=RIGID, label="rigid profile"),
            Line2D([], [], color=CONTACT, lw=1.6, label="contact"),
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=6)
        figure.savefig(path, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    draw(compute(), Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("loop.png"))
