"""Draws structure.png, the picture of docs/design.md: the packages and the data that flows.

Run it as ``.venv/bin/python docs/figures/structure.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

SOLVER, SHARP, ENSEMBLE, COMMANDS = "#dbe8f6", "#c3d6ee", "#fbe6d8", "#e4efdc"
WIDTH, HEIGHT = 2.0, 0.95

# name of the folder: (column, row, colour, what it holds)
CAMPAIGN = {
    "command": (0, 1, COMMANDS, "adhesis COMMAND"),
    "loop": (1, 1, ENSEMBLE, "files of one loop"),
    "trace": (2, 1, ENSEMBLE, "a measured trace"),
    "bench": (3, 1, ENSEMBLE, "speed against error"),
    "doctor": (4, 1, ENSEMBLE, "the installation"),
    "campaign": (0, 0, ENSEMBLE, "keys, rules, tasks"),
    "run": (1, 0, ENSEMBLE, "ranks, lock, signals"),
    "task": (2, 0, ENSEMBLE, "one loop → its row"),
    "results": (3, 0, ENSEMBLE, "the HDF5 file"),
    "aggregate": (4, 0, ENSEMBLE, "means, intervals"),
    "report": (5, 0, ENSEMBLE, "figures, tables, page"),
}
LOOP = {
    "model": (0, 3, SOLVER, "profile, half-space,\ncontrol, contact state"),
    "loading": (2, 3, SOLVER, "loop, path: losses,\njumps, energy audit"),
    "validate": (4, 3, SOLVER, "error against bound"),
    "references": (5, 3, SOLVER, "closed forms"),
    "grid": (3, 2, SOLVER, "sets of nodes"),
    "sharp": (2, 2, SHARP, "real-valued edges"),
    "runtime": (5, 2, SOLVER, "compilation, threads,\nsignals, memory"),
    "output": (0, 1, SHARP, "states and fields\nin SI units"),
    "continuation": (1, 1, SHARP, "predictor, step size,\nevents, jumps"),
    "nucleation": (2, 1, SHARP, "first touch in a gap"),
    "system": (3, 1, SHARP, "few or many gaps\nbehind one interface"),
    "gap": (1, 0, SHARP, "conformal map,\nquadrature, stress"),
    "field": (2, 0, SHARP, "dense, or on a\ntree of clusters"),
    "equilibrium": (3, 0, SHARP, "Griffith, Newton,\nwindows"),
    "descent": (4, 0, SHARP, "gradient flow\nof the edges"),
}
# from, to, what flows
CAMPAIGN_ARROWS = (
    ("command", "campaign", ""),
    ("campaign", "run", "tasks"),
    ("run", "task", "task"),
    ("task", "results", "row"),
    ("results", "aggregate", "blocks"),
    ("aggregate", "report", "means"),
)
LOOP_ARROWS = (
    ("model", "loading", "problem"),
    ("sharp", "loading", "states, jumps"),
    ("grid", "loading", ""),
    ("references", "validate", "exact"),
    ("loading", "validate", "losses"),
    ("gap", "field", "load"),
    ("field", "equilibrium", "C"),
    ("equilibrium", "descent", "∂C"),
    ("equilibrium", "system", "point"),
    ("descent", "system", "minimum"),
    ("system", "nucleation", "fields"),
    ("nucleation", "continuation", "touch"),
    ("continuation", "output", "points"),
    ("continuation", "sharp", "     history"),
)


def place(box: tuple[int, int, str, str], scale: float) -> tuple[float, float]:
    """Return the lower left corner of a box."""
    return box[0] * 2.75, box[1] * scale


def panel(
    axes: Axes,
    boxes: dict[str, tuple[int, int, str, str]],
    arrows: tuple[tuple[str, str, str], ...],
    title: str,
    scale: float = 1.75,
) -> None:
    """Draw one panel."""
    for name, box in boxes.items():
        x, y = place(box, scale)
        patch = FancyBboxPatch((x, y), WIDTH, HEIGHT, boxstyle="round,pad=0.05")
        patch.set(facecolor=box[2], edgecolor="0.4", linewidth=0.8)
        axes.add_patch(patch)
        centre = x + WIDTH / 2
        axes.text(centre, y + 0.74, name, ha="center", va="center", fontsize=10, weight="bold")
        axes.text(centre, y + 0.3, box[3], ha="center", va="center", fontsize=7.5)
    for one, other, label in arrows:
        (x, y), (x2, y2) = place(boxes[one], scale), place(boxes[other], scale)
        if y == y2:
            start = (x + WIDTH + 0.06, y + HEIGHT / 2) if x2 > x else (x - 0.06, y + HEIGHT / 2)
            end = (x2 - 0.06, y2 + HEIGHT / 2) if x2 > x else (x2 + WIDTH + 0.06, y2 + HEIGHT / 2)
        else:
            shift = 0.3 * ((x2 > x) - (x2 < x))
            up = y2 > y
            start = x + WIDTH / 2 + shift, y + HEIGHT + 0.06 if up else y - 0.06
            end = x2 + WIDTH / 2 - shift, y2 - 0.06 if up else y2 + HEIGHT + 0.06
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "0.3", "lw": 1.1})
        middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
        above = (middle[0], middle[1] + 0.12) if y == y2 else (middle[0] + 0.1, middle[1] - 0.06)
        align = "center" if y == y2 else "left"
        axes.text(*above, label, ha=align, va="bottom", fontsize=7.5, color="0.2")
    axes.set_title(title, loc="left", fontsize=11)
    rows = max(box[1] for box in boxes.values())
    axes.set(xlim=(-0.3, 5 * 2.75 + WIDTH + 0.3), ylim=(-0.25, rows * scale + HEIGHT + 0.25))
    axes.set_aspect("equal")
    axes.axis("off")


def draw(path: Path) -> None:
    """Draw both panels."""
    figure, (top, bottom) = plt.subplots(
        2, 1, figsize=(11, 8), layout="constrained", height_ratios=(1, 2.2)
    )
    panel(top, CAMPAIGN, CAMPAIGN_ARROWS, "A campaign: the folders of ensemble/")
    panel(
        bottom, LOOP, LOOP_ARROWS, "A loop: the folders of solver/, those of solver/sharp/ darker"
    )
    figure.savefig(path, dpi=130)
    plt.close(figure)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("structure.png"))
