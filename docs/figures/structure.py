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

SOLVER, SHARP, ENSEMBLE, COMMANDS = "#dbe8f6", "#b9cfea", "#fbe6d8", "#e4efdc"
WIDTH, HEIGHT = 2.0, 0.95
COLUMN, ROW = 2.92, 1.75
DIAGONAL = 0.8  # from the middle of a box to the end of an arrow to another column
WIDE = ("command",)  # from the first column to the last
INCH = 0.4  # of one unit: six columns fill two columns of a journal

# name of the folder: (column, row, colour, what it holds)
CAMPAIGN = {
    "command": (0, 2, COMMANDS, "one module for each command: adhesis run, report, loop, trace …"),
    "loop": (1, 1, ENSEMBLE, "files of one loop"),
    "trace": (2, 1, ENSEMBLE, "a measured trace\nto its loss"),
    "bench": (3, 1, ENSEMBLE, "speed against\nerror"),
    "doctor": (4, 1, ENSEMBLE, "the installation"),
    "campaign": (0, 0, ENSEMBLE, "keys, rules, tasks"),
    "run": (1, 0, ENSEMBLE, "hands tasks\nto ranks"),
    "task": (2, 0, ENSEMBLE, "runs one loop,\nmakes its row"),
    "results": (3, 0, ENSEMBLE, "the HDF5 file"),
    "aggregate": (4, 0, ENSEMBLE, "means, intervals,\nfrom the file alone"),
    "report": (5, 0, ENSEMBLE, "figures, tables,\npage"),
}
LOOP = {
    "model": (0, 4, SOLVER, "profile, half-space,\ncontrol, states"),
    "loading": (1, 4, SOLVER, "follows a path:\nlosses and audit"),
    "validate": (3, 4, SOLVER, "errors and bounds"),
    "references": (4, 4, SOLVER, "closed forms"),
    "sharp": (1, 3, SHARP, "method with real-\nvalued edges"),
    "grid": (2, 3, SOLVER, "method with sets\nof nodes"),
    "runtime": (5, 4, SOLVER, "threads, signals\n(for all)"),
    "output": (1, 2, SHARP, "states and fields\nin SI units"),
    "continuation": (2, 2, SHARP, "predictor, steps,\nevents, jumps"),
    "nucleation": (2, 1, SHARP, "first touch,\nseed patches"),
    "gap": (1, 0, SHARP, "ends of gaps,\nfull-contact stress"),
    "field": (2, 0, SHARP, "fields of given\nedges, openings"),
}
# from, to, what flows
CAMPAIGN_ARROWS = (
    ("command", "campaign", ""),
    ("command", "loop", ""),
    ("command", "trace", ""),
    ("command", "bench", ""),
    ("command", "doctor", ""),
    ("command", "report", ""),
    ("campaign", "run", "tasks"),
    ("run", "task", "task"),
    ("task", "results", "row"),
    ("results", "aggregate", "blocks"),
    ("aggregate", "report", "means"),
)
LOOP_ARROWS = (
    ("model", "loading", "problem"),
    ("loading", "sharp", "next value\nto reach"),
    ("sharp", "loading", "states,\njumps"),
    ("grid", "loading", ""),
    ("loading", "validate", "losses"),
    ("references", "validate", "exact"),
    ("output", "sharp", "states"),
    ("continuation", "output", "points"),
    ("nucleation", "continuation", "touches"),
    ("field", "nucleation", "openings"),
    ("gap", "field", "stress"),
)


def width_of(name: str) -> float:
    """Return the width of a box."""
    return 5 * COLUMN + WIDTH if name in WIDE else WIDTH


def corner(box: tuple[int, int, str, str]) -> tuple[float, float]:
    """Return the lower left corner of a box."""
    return box[0] * COLUMN, box[1] * ROW


def draw_arrow(
    axes: Axes,
    boxes: dict[str, tuple[int, int, str, str]],
    arrow: tuple[str, str, str],
    aside: float,
) -> None:
    """Draw one arrow with its label; one of a pair is moved aside."""
    name, other, label = arrow
    (x, y), (x2, y2) = corner(boxes[name]), corner(boxes[other])
    if name in WIDE:
        x = x2
    pad = 0.07
    if y == y2:
        right = x2 > x
        start = (x + WIDTH + pad if right else x - pad), y + HEIGHT / 2
        end = (x2 - pad if right else x2 + WIDTH + pad), y2 + HEIGHT / 2
        text, align = ((start[0] + end[0]) / 2, start[1] + 0.1), ("center", "bottom")
    else:
        across = (x2 > x) - (x2 < x)
        shift, up = DIAGONAL * across, y2 > y
        start = x + WIDTH / 2 + shift + aside, (y + HEIGHT + pad if up else y - pad)
        end = x2 + WIDTH / 2 - shift + aside, (y2 - pad if up else y2 + HEIGHT + pad)
        middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
        beside = 0.12 + 0.12 * abs(across)
        text = (middle[0] + beside if aside >= 0 else middle[0] - beside), middle[1]
        align = ("left" if aside >= 0 else "right"), "center"
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "0.3", "lw": 0.9})
    axes.text(*text, label, ha=align[0], va=align[1], fontsize=6, color="0.2", linespacing=0.95)


def draw_panel(
    axes: Axes,
    boxes: dict[str, tuple[int, int, str, str]],
    arrows: tuple[tuple[str, str, str], ...],
    title: str,
) -> None:
    """Draw one panel."""
    for name, box in boxes.items():
        x, y = corner(box)
        patch = FancyBboxPatch((x, y), width_of(name), HEIGHT, boxstyle="round,pad=0.05")
        patch.set(facecolor=box[2], edgecolor="0.4", linewidth=0.7)
        axes.add_patch(patch)
        centre = x + width_of(name) / 2
        axes.text(centre, y + 0.75, name, ha="center", va="center", fontsize=7, weight="bold")
        axes.text(centre, y + 0.28, box[3], ha="center", va="center", fontsize=6, linespacing=1.1)
    pairs = {(one, other) for one, other, _ in arrows}
    for arrow in arrows:
        aside = 0.0
        if (arrow[1], arrow[0]) in pairs:
            aside = -0.2 if boxes[arrow[1]][1] < boxes[arrow[0]][1] else 0.2
        draw_arrow(axes, boxes, arrow, aside)
    axes.set_title(title, loc="left", fontsize=7.5)
    rows = max(box[1] for box in boxes.values())
    axes.set(xlim=(-0.1, 5 * COLUMN + WIDTH + 0.1), ylim=(-0.15, rows * ROW + HEIGHT + 0.15))
    axes.set_aspect("equal")
    axes.axis("off")


def draw(path: Path) -> None:
    """Draw both panels."""
    heights = [max(box[1] for box in boxes.values()) * ROW + 1.25 for boxes in (CAMPAIGN, LOOP)]
    figure, (top, bottom) = plt.subplots(
        2,
        1,
        figsize=(INCH * (5 * COLUMN + WIDTH + 0.4), INCH * (sum(heights) + 1.6)),
        layout="constrained",
        height_ratios=heights,
    )
    draw_panel(top, CAMPAIGN, CAMPAIGN_ARROWS, "A campaign: the folders of ensemble/")
    draw_panel(
        bottom, LOOP, LOOP_ARROWS, "A loop: the folders of solver/, those of solver/sharp/ darker"
    )
    figure.savefig(path, dpi=300, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("structure.png"))
