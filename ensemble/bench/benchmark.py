"""Measure CPU time and memory of every method against its error in the loss; tables.

On every scene (:mod:`adhesis.ensemble.bench.scenes`) each method runs the same loop at several
resolutions, every run in a process of its own (:mod:`adhesis.ensemble.bench.measure`). Errors are
those of the loop integral, relative to the closed form or to a reference run of ``sharp``: the most
accurate that finishes in time, which the page names. With little time it can be less accurate than
measured runs, whose errors are then its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from adhesis.ensemble.bench.measure import Measurement, Run, measure
from adhesis.ensemble.bench.scenes import Scene
from adhesis.ensemble.report.tables.table import BLANK, TableColumn, fixed, make_table

# Doubling the nodes multiplies the time of a grid run by up to this factor.
_COST_OF_DOUBLING = 4.0
# Time limit of the reference run, in units of that of a measured run.
_REFERENCE_LIMIT = 3.0
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
    TableColumn("reference_loss", lambda line: line.reference[0]),
    TableColumn("reference", lambda line: line.reference[1]),
    TableColumn("note", "measured.note", "note", only_if_any=True),
)


@dataclass(frozen=True)
class Line:
    """One line of the table."""

    run: Run
    reference: tuple[float, str]  # loss to which errors refer, in J/m², and its origin
    measured: Measurement

    @property
    def error(self) -> float:
        """(loss - reference) / reference."""
        return self.measured.loss / self.reference[0] - 1


def benchmark(scenes: Sequence[Scene], *, seconds: float) -> Iterator[Line]:
    """Measure the methods on the scenes, one line after the other.

    A run is given up after so many CPU seconds. A grid that would take longer, estimated from the
    one before it, is left out. Both give lines with a note.
    """
    for scene in scenes:
        reference, before = _reference(scene, seconds), 0.0
        for nodes in scene.grids:
            run = Run(scene, "grid", nodes, scene.load_steps, seconds)
            measured = Measurement(note=f"left out: it would take more than {seconds:g} s")
            if before * _COST_OF_DOUBLING <= seconds:
                measured = measure(run)
            before = measured.cpu_seconds  # NaN if the run did not finish
            yield Line(run, reference, measured)
        for accuracy in scene.accuracies:
            run = Run(scene, "sharp", accuracy, scene.load_steps, seconds)
            yield Line(run, reference, measure(run))


def _reference(scene: Scene, seconds: float) -> tuple[float, str]:
    if scene.exact_loss is not None:
        return scene.exact_loss, "closed form"
    for accuracy in scene.tightest:
        limit = _REFERENCE_LIMIT * seconds
        run = Run(scene, "sharp", accuracy, scene.reference_load_steps, limit)
        loss = measure(run).loss
        if math.isfinite(loss):
            return loss, f"sharp, accuracy {run.described}, {run.load_steps} load steps"
    return math.nan, "none: no reference run finished"


def page(lines: Sequence[Line], made_by: str) -> str:
    """Return the Markdown page: a table for each scene."""
    parts = [f"Made by {made_by}."]
    for scene in dict.fromkeys(line.run.scene for line in lines):
        chosen = [line for line in lines if line.run.scene is scene]
        parts += [
            f"### {scene.title[0].upper()}{scene.title[1:]}",
            f"Δ~max = {scene.max_penetration:g}, {scene.load_steps} load steps. "
            f"Reference: {chosen[0].reference[1]}.",
            make_table("", COLUMNS, chosen).markdown(),
        ]
    return "\n\n".join(parts) + "\n"
