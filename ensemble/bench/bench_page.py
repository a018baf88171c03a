"""Write the tables of the benchmark: the columns of the CSV file and of the Markdown page."""

from __future__ import annotations

from collections.abc import Sequence

from adhesis.ensemble.bench.equal_error import Line, Ratio
from adhesis.ensemble.report.tables.table import BLANK, TableColumn, fixed, make_table

COLUMNS = (
    TableColumn("scene", "run.scene.name"),
    TableColumn("method", "run.method", "method"),
    TableColumn("setting", "run.setting"),
    TableColumn("", "run.described", "setting"),
    TableColumn("load_steps", "run.load_steps"),
    TableColumn("cpu_seconds", "measured.cpu_seconds", "CPU s", lambda s: f"{s:.{1 + (s < 10)}f}"),
    TableColumn("megabytes", "measured.megabytes", "MB", fixed(0)),
    TableColumn("megabytes_before", "measured.megabytes_before"),
    TableColumn("loss", "measured.loss"),
    TableColumn("loss_dimensionless", "measured.loss_dimensionless", "W~", "{:.6g}".format),
    TableColumn("error", "error", "error", "{:+.1e}".format),
    TableColumn("audit_residual", "measured.audit_residual", "audit", "{:+.1e}".format),
    TableColumn("solutions", "measured.solutions", "solutions", lambda n: str(n or BLANK)),
    TableColumn("jumps", "measured.jumps"),
    TableColumn("patches", "measured.patches"),
    TableColumn("reference_loss", "reference.loss"),
    TableColumn("reference", "reference.text"),
    TableColumn("note", "measured.note", "note", only_if_any=True),
)
_RATIOS = (
    TableColumn("", "line.run.scene.title", "scene"),
    TableColumn("", "line.run.described", "sharp"),
    TableColumn("", lambda ratio: abs(ratio.line.error), "error", "{:.1e}".format),
    TableColumn("", "converged", "grid / sharp"),
    TableColumn("", "cheapest", "cheapest grid / sharp"),
)


def page(lines: Sequence[Line], compared: Sequence[Ratio], made_by: str) -> str:
    """Return the Markdown page: a table for each scene, and the ratios."""
    parts = [f"Made by {made_by}."]
    for scene in dict.fromkeys(line.run.scene for line in lines):
        chosen = [line for line in lines if line.run.scene is scene]
        parts += [
            f"### {scene.title[0].upper()}{scene.title[1:]}",
            f"Δ~max = {scene.max_penetration:g}, {scene.load_steps} load steps. "
            f"Reference: {chosen[0].reference.text}.",
            make_table("", COLUMNS, chosen).markdown(),
        ]
    if compared:
        table = make_table("", _RATIOS, compared).markdown()
        parts += ["### CPU time of grid over sharp at equal error", table]
    return "\n\n".join(parts) + "\n"
