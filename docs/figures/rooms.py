"""Draws rooms.png, the picture of docs/design.md: the rooms and what flows between them.

Run it as ``.venv/bin/python docs/figures/rooms.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

SOLVER, ENSEMBLE, DOOR = "#dbe8f6", "#fbe6d8", "#e4efdc"

# name: (x, y, width, colour, what it says below its name)
BOXES = {
    "campaign": (0.0, 6.0, 1.7, ENSEMBLE, "tables, rules, tasks"),
    "run": (2.6, 6.0, 1.7, ENSEMBLE, "ranks, lock, signals"),
    "task": (5.2, 6.0, 1.7, ENSEMBLE, "one loop, its row"),
    "results": (7.8, 6.0, 1.7, ENSEMBLE, "the HDF5 file"),
    "aggregate": (10.4, 6.0, 1.7, ENSEMBLE, "averages"),
    "report": (13.0, 6.0, 1.7, ENSEMBLE, "figures, tables, page"),
    "command": (0.0, 8.0, 1.7, DOOR, "adhesis COMMAND"),
    "loop": (2.6, 8.0, 1.7, ENSEMBLE, "JSON of one loop"),
    "trace": (5.2, 8.0, 1.7, ENSEMBLE, "a measured trace"),
    "bench": (7.8, 8.0, 1.7, ENSEMBLE, "speed against error"),
    "doctor": (10.4, 8.0, 1.7, ENSEMBLE, "the installation"),
    "adhesis": (0.0, 3.6, 1.7, DOOR, "import adhesis"),
    "problem": (2.6, 3.6, 1.7, SOLVER, "profile, material, γ"),
    "method": (5.2, 3.6, 1.7, SOLVER, "the contract, states"),
    "loop, path": (7.8, 3.6, 1.7, SOLVER, "losses, audit"),
    "fields, jumps": (10.4, 3.6, 1.7, SOLVER, "what is seen in states"),
    "sharp": (3.9, 1.6, 1.7, SOLVER, "real-valued edges"),
    "grid": (6.5, 1.6, 1.7, SOLVER, "sets of nodes"),
    "references": (10.4, 1.6, 1.7, SOLVER, "closed forms"),
    "validate": (13.0, 1.6, 1.7, SOLVER, "error against bound"),
}
HEIGHT = 0.95
# from, to, label, where the label stands beside the middle of the arrow
ARROWS = (
    ("campaign", "run", "tasks", (0, 0.16)),
    ("run", "task", "a task\na rank", (0, 0.1)),
    ("task", "results", "rows", (0, 0.16)),
    ("results", "aggregate", "blocks", (0, 0.16)),
    ("aggregate", "report", "means", (0, 0.16)),
    ("problem", "method", "scene", (0, 0.16)),
    ("method", "loop, path", "states", (0, 0.16)),
    ("loop, path", "fields, jumps", "", (0, 0)),
    ("sharp", "method", "is one", (-0.5, 0)),
    ("grid", "method", "is one", (0.5, 0)),
    ("references", "validate", "exact", (0, 0.16)),
)


def edge(name: str, towards: str) -> tuple[float, float]:
    """Return where an arrow leaves a box."""
    x, y, width, *_ = BOXES[name]
    x2, y2, width2, *_ = BOXES[towards]
    if y == y2:
        return (x + width if x2 > x else x), y + HEIGHT / 2
    middle = x + width / 2 + 0.25 * (1 if x2 + width2 / 2 > x + width / 2 else -1)
    return middle, (y + HEIGHT if y2 > y else y)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], style: str) -> None:
    """One arrow."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": style, "color": "0.3", "lw": 1.1})


def draw(path: Path) -> None:
    """All of it."""
    figure, axes = plt.subplots(figsize=(11, 6.2), layout="constrained")
    bands = (
        (1.3, 3.7, "solver/  mechanics: no MPI, no files", SOLVER),
        (5.7, 3.7, "ensemble/  campaigns: no mechanics of their own", ENSEMBLE),
    )
    for y, height, title, colour in bands:
        band = FancyBboxPatch((-0.4, y), 15.5, height, boxstyle="round,pad=0.1")
        band.set(facecolor="none", edgecolor=colour, linewidth=3)
        axes.add_patch(band)
        axes.text(15.0, y + height - 0.15, title, ha="right", va="top", fontsize=10, color="0.3")
    for name, (x, y, width, colour, text) in BOXES.items():
        box = FancyBboxPatch((x, y), width, HEIGHT, boxstyle="round,pad=0.05")
        box.set(facecolor=colour, edgecolor="0.4", linewidth=0.8)
        axes.add_patch(box)
        centre = x + width / 2
        axes.text(centre, y + 0.65, name, ha="center", va="center", fontsize=10.5, weight="bold")
        axes.text(centre, y + 0.25, text, ha="center", va="center", fontsize=7.5)
    for one, other, label, (dx, dy) in ARROWS:
        start, end = edge(one, other), edge(other, one)
        arrow(axes, start, end, "-|>")
        middle = (start[0] + end[0]) / 2 + dx, (start[1] + end[1]) / 2 + dy
        axes.text(*middle, label, ha="center", va="bottom", fontsize=8, color="0.25")
    # Where campaigns meet mechanics: a problem goes down, a loop comes up.
    arrow(axes, (5.8, 6.0), (3.8, 4.55), "-|>")
    axes.text(4.5, 5.18, "problem", ha="right", fontsize=8, color="0.25")
    arrow(axes, (8.2, 4.55), (6.4, 6.0), "-|>")
    axes.text(7.5, 5.18, "loop", ha="left", fontsize=8, color="0.25")
    arrow(axes, (0.85, 8.0), (0.85, 6.95), "-|>")
    arrow(axes, (1.7, 4.1), (2.6, 4.1), "-|>")
    axes.set(xlim=(-0.7, 15.4), ylim=(1.0, 9.7))
    axes.axis("off")
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("rooms.png"))
