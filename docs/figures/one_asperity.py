"""Draws one_asperity.png: why a single elastic wave loses energy, with its two jumps.

Run it as ``.venv/bin/python docs/figures/one_asperity.py``. Everything is Johnson's closed form.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from adhesis.solver.references.single_wave import SingleWave

LOADING, UNLOADING, CONTACT = "#1f5fa8", "#c4472b", "#d62728"
BODY, RIGID = "#dbe4ee", "#8a8f98"
WAVE = SingleWave(amplitude=1e-6, period=1e-4, modulus=4e6 / 3, work_of_adhesion=0.004)


def draw_bodies(axes: Axes, half_width: float, separation: float, title: str) -> None:
    """Draw the elastic body above the rigid wave; a half-width of 0 is no contact."""
    x = np.linspace(-0.5, 0.5, 801) * WAVE.period
    height = WAVE.amplitude * np.cos(2 * np.pi * x / WAVE.period)
    surface = np.full(x.size, separation)
    if half_width:
        surface = height + WAVE.gap(x, half_width)
    top = 4.2e-6
    axes.fill_between(1e6 * x, 1e6 * surface, 1e6 * top, color=BODY, lw=0)
    axes.plot(1e6 * x, 1e6 * surface, color="#51667d", lw=1)
    axes.fill_between(1e6 * x, -1.6, 1e6 * height, color=RIGID, lw=0)
    if half_width:
        inside = np.abs(x) <= half_width
        axes.plot(1e6 * x[inside], 1e6 * height[inside], color=CONTACT, lw=2.5)
    axes.set(xlim=(-50, 50), ylim=(-1.6, 1e6 * top), xticks=[], yticks=[])
    axes.set_title(title, fontsize=9)


def draw_loop(axes: Axes) -> None:
    """Draw the mean stress against the penetration, with the branch that is unstable."""
    loop = WAVE.loop
    half = np.linspace(loop.fold_half_width, 0.18 * WAVE.period, 400)
    small = np.geomspace(1e-3 * loop.fold_half_width, loop.fold_half_width, 200)

    def place(a: np.ndarray | float) -> np.ndarray:
        return (WAVE.amplitude - WAVE.separation(a)) / WAVE.amplitude

    def stress(a: np.ndarray | float) -> np.ndarray:
        return WAVE.mean_stress(a) / 1e3

    touch, fold = loop.touch_half_width, loop.fold_half_width
    lost = half[half <= touch]
    axes.fill(
        [*place(lost), 0.0, float(place(fold))],
        [*stress(lost), 0.0, 0.0],
        color="#f3d6cd",
        lw=0,
    )
    axes.plot(place(small), stress(small), color="0.6", ls=":", lw=1, label="unstable")
    axes.plot(place(half), stress(half), color=UNLOADING, lw=2.2, label="unloading")
    both = half[half >= touch]
    axes.plot(place(both), stress(both), color=LOADING, lw=1.2, label="loading")
    axes.annotate("", (0, stress(touch)), (0, 0), arrowprops={"arrowstyle": "->", "color": LOADING})
    axes.annotate(
        "",
        (place(fold), 0),
        (place(fold), stress(fold)),
        arrowprops={"arrowstyle": "->", "color": UNLOADING},
    )
    marks = (
        ("A", 0.0, 0.0, (4, 4)),
        ("B", 0.0, stress(touch), (6, -6)),
        ("C", place(fold), stress(fold), (-4, -12)),
        ("D", place(fold), 0.0, (-12, 4)),
    )
    for name, x, y, shift in marks:
        axes.plot(x, y, "ko", ms=3.5)
        axes.annotate(name, (float(x), float(y)), shift, textcoords="offset points", fontsize=9)
    axes.text(
        0.5 * float(place(fold)),
        0.42 * float(stress(fold)),
        "loss",
        color=UNLOADING,
        ha="center",
        fontsize=9,
    )
    axes.axhline(0, color="0.6", lw=0.6, zorder=0)
    axes.set(
        xlabel="penetration $\\Delta/h_{max}$",
        ylabel="mean stress $\\bar p$ (kPa)",
        title="Stress along the loop",
    )
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def draw_energy(axes: Axes) -> None:
    """Draw the energy against the half-width of the contact, at three separations."""
    loop = WAVE.loop
    half = np.linspace(1e-4, 0.175, 600) * WAVE.period
    middle = 0.5 * (WAVE.amplitude + loop.fold_separation)
    rows = (
        (WAVE.amplitude, LOADING, "A: first touch"),
        (middle, "0.45", "between"),
        (loop.fold_separation, UNLOADING, "C: end of the minimum"),
    )
    for separation, colour, label in rows:
        energy = 1e3 * WAVE.energy_at(half, separation) / WAVE.period
        axes.plot(100 * half / WAVE.period, energy, color=colour, lw=1.4, label=label)
    for a, separation, target, colour in (
        (0.0, WAVE.amplitude, loop.touch_half_width, LOADING),
        (loop.fold_half_width, loop.fold_separation, 0.0, UNLOADING),
    ):
        start = 1e3 * float(WAVE.energy_at(a, separation)) / WAVE.period if a else 0.0
        end = 1e3 * float(WAVE.energy_at(target, separation)) / WAVE.period if target else 0.0
        axes.plot(100 * a / WAVE.period, start, "o", ms=5, mfc="w", color=colour)
        axes.plot(100 * target / WAVE.period, end, "o", ms=5, color=colour)
        axes.annotate(
            "",
            (100 * target / WAVE.period, end),
            (100 * a / WAVE.period, start),
            arrowprops={"arrowstyle": "->", "color": colour, "ls": "--", "shrinkA": 5},
        )
    axes.set(
        xlabel="half-width of the contact $a/\\lambda$ (%)",
        ylabel="energy $U/\\lambda$ (mJ/m²)",
        title="Energy at fixed separation",
        ylim=(-0.8, 1.7),
    )
    axes.axhline(0, color="0.6", lw=0.6, zorder=0)
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def main() -> None:
    """Draw the figure."""
    path = Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("one_asperity.png")
    figure, panels = plt.subplot_mosaic(
        [["A", "B", "C", "D"], ["loop", "loop", "energy", "energy"]],
        height_ratios=[1, 1.9],
        figsize=(9, 5.4),
        layout="constrained",
    )
    loop = WAVE.loop
    draw_bodies(panels["A"], 0.0, WAVE.amplitude, "A  first touch")
    draw_bodies(panels["B"], loop.touch_half_width, WAVE.amplitude, "B  after snap-in: a neck")
    draw_bodies(panels["C"], loop.fold_half_width, loop.fold_separation, "C  stretched neck")
    draw_bodies(panels["D"], 0.0, loop.fold_separation, "D  after pull-off")
    panels["A"].text(0, 2.6, "elastic", ha="center", fontsize=9, color="#51667d")
    panels["A"].text(0, -0.9, "rigid", ha="center", fontsize=9, color="w")
    draw_loop(panels["loop"])
    draw_energy(panels["energy"])
    figure.savefig(path, dpi=160)


if __name__ == "__main__":
    main()
