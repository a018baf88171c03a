"""Names of the files of a trace's page."""

from __future__ import annotations

FIGURES = {
    "trace": "The trace, as measured and as used",
    "spectrum": "Its power spectrum",
    "loop": "The loop",
    "cut-off": "Loss against the shortest wave kept",
    "tables": "Against work of adhesion and turning point",
}
"""Title of each figure by the stem of its files."""

FIGURE_FILES = tuple(f"{name}.{suffix}" for name in FIGURES for suffix in ("png", "pdf"))
"""Those that a page does not show are removed from its folder."""

FILES = ("trace.json", "trace.html", "trace.md", *FIGURE_FILES)
