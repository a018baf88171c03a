"""Draws two_methods.png: contact as a set of nodes, and as edges that are real numbers.

Run it as ``.venv/bin/python docs/figures/two_methods.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave

GRID, SHARP = "#2f8f5b", "#1f5fa8"
BODY, RIGID = "#dbe4ee", "#8a8f98"
PERIOD, AMPLITUDE = 1e-4, 1e-6
PROBLEM = Problem(single_wave(AMPLITUDE, PERIOD), HalfSpace(1e6, 0.5), 0.004)
AT = -0.2  # penetration of the drawn state, on unloading


def state_of(name: str, **options: int) -> tuple[object, object]:
    """Return a method, and its state on unloading at the drawn penetration."""
    method = make_method(name, PROBLEM, **options)
    loop = run_loop(method, max_penetration=0.5, load_steps=10)
    rows = [k for k in loop.states("unloading") if loop.contact_states[k].patches]
    nearest = min(rows, key=lambda k: abs(loop.penetration[k] - AT))
    start = loop.contact_states[nearest]
    return method, method.follow(start, PROBLEM.separation(AT)).states[-1]


def draw_gap(axes: Axes) -> None:
    """Draw the neck: nodes of the grid, and the gap between two edges."""
    grid, coarse = state_of("grid", nodes_per_wave=64)
    sharp, exact = state_of("sharp")
    nodes = grid.fields(coarse, grid.nodes // 16 if grid.nodes > 64 else grid.nodes)
    fine = sharp.fields(exact, 4096)
    x = np.linspace(-0.5, 0.5, 2001) * PERIOD
    place = ((fine.x + 0.5 * PERIOD) % PERIOD) - 0.5 * PERIOD
    order = np.argsort(place)
    surface = (fine.height + fine.gap)[order]
    axes.fill_between(1e6 * place[order], 1e6 * surface, 3.4, color=BODY, lw=0)
    axes.fill_between(1e6 * x, -1.3, 1e6 * PROBLEM.profile.at(x), color=RIGID, lw=0)
    axes.plot(
        1e6 * place[order],
        1e6 * surface,
        color=SHARP,
        lw=1.2,
        label="sharp: a crack between edges",
    )
    spot = ((nodes.x + 0.5 * PERIOD) % PERIOD) - 0.5 * PERIOD
    inside = nodes.gap <= 0
    axes.plot(
        1e6 * spot[~inside],
        1e6 * (nodes.height + nodes.gap)[~inside],
        "o",
        ms=3.5,
        mfc="w",
        color=GRID,
        label="grid: free nodes",
    )
    axes.plot(
        1e6 * spot[inside],
        1e6 * nodes.height[inside],
        "o",
        ms=3.5,
        color=GRID,
        label="grid: contact nodes",
    )
    for edge in np.ravel(exact.edges):
        at = ((edge + 0.5 * PERIOD) % PERIOD) - 0.5 * PERIOD
        height = PROBLEM.profile.at(np.array([at]))[0]
        axes.plot(1e6 * at, 1e6 * height, "|", ms=16, mew=2, color="k")
    axes.set(xlim=(-50, 50), ylim=(-1.3, 3.4), xlabel="position (µm)", ylabel="height (µm)")
    axes.set_title("what is known of a contact", fontsize=10)
    axes.legend(frameon=False, fontsize=8, loc="upper center")


def draw_stress(axes: Axes) -> None:
    """Draw the stress near an edge by both methods."""
    grid, coarse = state_of("grid", nodes_per_wave=64)
    sharp, exact = state_of("sharp")
    nodes = grid.fields(coarse, grid.nodes)
    fine = sharp.fields(exact, 1 << 15)
    edge = float(exact.edges[0, 1]) % PERIOD
    for fields, style, colour, name in (
        (fine, "-", SHARP, "sharp"),
        (nodes, "o", GRID, "grid, each node"),
    ):
        place = (fields.x - edge + 0.5 * PERIOD) % PERIOD - 0.5 * PERIOD
        order = np.argsort(place)
        close = np.abs(place[order]) < 5e-6
        axes.plot(
            1e6 * place[order][close],
            fields.stress[order][close] / 1e3,
            style,
            ms=4,
            lw=1.2,
            color=colour,
            label=name,
        )
    axes.axhline(0, color="0.6", lw=0.6, zorder=0)
    lowest = nodes.stress.min() / 1e3
    axes.set(xlabel="distance from the edge (µm)", ylabel="stress (kPa)", ylim=(2.2 * lowest, None))
    axes.set_title("stress at an edge: $-K/\\sqrt{2\\pi r}$", fontsize=10)
    axes.legend(frameon=False, fontsize=8)


def draw_branch(axes: Axes) -> None:
    """Draw the edge along the branch of unloading, to the fold and beyond."""
    method = make_method("sharp", PROBLEM)
    loop = run_loop(method, max_penetration=0.5, load_steps=10)
    rows = [k for k in loop.states("unloading") if loop.contact_states[k].patches]
    width = np.array([float(np.diff(loop.contact_states[k].edges[0])[0]) / 2 for k in rows])
    places = loop.penetration[rows]
    axes.plot(places, 1e6 * width, "o-", ms=2, lw=0.8, color=SHARP, label="points of the branch")
    axes.annotate(
        "fold: the minimum ends,\nthe edges run",
        (places[-1], 1e6 * width[-1]),
        (22, 4),
        textcoords="offset points",
        fontsize=8,
        arrowprops={"arrowstyle": "-", "color": "0.4", "lw": 0.7},
    )
    axes.annotate(
        "",
        (places[-1], 0),
        (places[-1], 1e6 * width[-1]),
        arrowprops={"arrowstyle": "->", "color": "#c4472b", "lw": 1.5},
    )
    axes.set(
        xlabel="penetration $\\Delta/h_{max}$", ylabel="position of the edge (µm)", ylim=(0, None)
    )
    axes.set_title("sharp: a branch and its end", fontsize=10)
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def main() -> None:
    """Draw the figure."""
    path = Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("two_methods.png")
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(10.5, 3.5), layout="constrained")
    draw_gap(left)
    draw_stress(middle)
    draw_branch(right)
    figure.savefig(path, dpi=160)


if __name__ == "__main__":
    main()
