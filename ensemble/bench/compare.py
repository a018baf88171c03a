"""What accuracy costs: CPU time and memory of every method against its error in the loss.

On every scene (:mod:`adhesis.ensemble.bench.scenes`) each method runs the same loop at several
resolutions, every run in a process of its own (:mod:`adhesis.ensemble.bench.measure`). Errors are
those of the loop integral, relative to the closed form or to a reference run of ``sharp`` that is
tighter than every measured one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from adhesis.ensemble.bench.measure import Measured, Measurement, Run, measure
from adhesis.ensemble.bench.scenes import FULL, GROWTH, QUICK, WARM_UP, Scene
from adhesis.ensemble.bench.tamaas import has_tamaas

__all__ = [
    "FULL",
    "GROWTH",
    "QUICK",
    "Exponent",
    "Line",
    "Quotient",
    "Ratio",
    "Reference",
    "benchmark",
    "exponents",
    "growth",
    "ratios",
]

# Doubling the nodes costs a grid run up to this factor.
_NEXT_GRID = 4.0
# The reference may take this many times the limit of a measured run.
_REFERENCE_PATIENCE = 3.0
# tamaas does not locate jumps: its steps are finer by this factor.
_TAMAAS_STEPS = {"one-wave": 5}


@dataclass(frozen=True)
class Reference:
    """The loss that errors are measured against, in J/m², and what it is."""

    loss: float
    text: str


@dataclass(frozen=True)
class Line:
    """One line of the table."""

    run: Run
    reference: Reference
    measured: Measurement

    @property
    def error(self) -> float:
        """(loss - reference) / reference."""
        return self.measured.loss / self.reference.loss - 1


@dataclass(frozen=True)
class Quotient:
    """A ratio of CPU times at equal error.

    ``bound`` is "" if the error lies within the grid's series (interpolated, log-log), ">" if no
    grid run is as exact (``value`` is then the ratio to the most exact one: the true one is
    larger), "<" if the cheapest grid run is already more exact.
    """

    value: float
    bound: str


@dataclass(frozen=True)
class Ratio:
    """CPU time of ``grid`` over that of one run of ``sharp``, at the error of the latter.

    The errors of ``grid`` come from single jumps and change their sign from one number of nodes to
    the next: a coarse grid can be right by chance, and who has no reference does not know when.

    Attributes
    ----------
    kept : Quotient
        To the grid from which on every finer one that finished is as exact.
    lucky : Quotient
        To the cheapest grid that happens to be as exact.
    """

    line: Line
    kept: Quotient
    lucky: Quotient


@dataclass(frozen=True)
class Exponent:
    """Growth of the CPU time of ``sharp`` as a power, by least squares in the logarithms.

    Attributes
    ----------
    among : str
        What the lines have in common.
    variable : str
        What grows.
    least, most : int
        Its range.
    of_loop, of_solution : float
        Exponents of the CPU time of a loop, and of a solution.
    """

    among: str
    variable: str
    least: int
    most: int
    of_loop: float
    of_solution: float


def benchmark(
    scenes: Sequence[Scene] = FULL,
    *,
    seconds: float = 360.0,
    on_line: Callable[[Line], None] | None = None,
) -> list[Line]:
    """Measure the methods on the scenes.

    Parameters
    ----------
    scenes : sequence of Scene
    seconds : float
        CPU seconds after which a run is given up; a grid that would take longer, judged by the one
        before it, is left out. Both show as lines with a note.
    on_line : callable, optional
        Called with every line as it is measured.
    """
    lines: list[Line] = []
    _fill_caches()
    for scene in scenes:
        reference = _reference(scene, seconds)
        for run in _runs(scene, seconds):
            before = [line for line in lines if line.run.scene is scene]
            line = Line(run, reference, _left_out(run, before) or measure(run))
            lines.append(line)
            if on_line is not None:
                on_line(line)
    return lines


def growth(
    scenes: Sequence[Scene] = GROWTH,
    *,
    seconds: float = 360.0,
    on_line: Callable[[Line], None] | None = None,
) -> list[Line]:
    """Measure how cost grows; these lines have no reference and no error."""
    unknown = Reference(math.nan, "none")
    lines: list[Line] = []
    _fill_caches()
    for scene in scenes:
        settings: list[tuple[Measured, Sequence[float]]] = [
            ("sharp", scene.accuracies),
            ("grid", scene.grids),
        ]
        for method, values in settings:
            for value in values:
                run = Run(scene, method, value, scene.load_steps, seconds)
                lines.append(Line(run, unknown, measure(run)))
                if on_line is not None:
                    on_line(lines[-1])
    return lines


def exponents(lines: Sequence[Line]) -> list[Exponent]:
    """Fit how the CPU time of ``sharp`` grows with its patches, and with the wave numbers.

    From each series of finished lines of :func:`growth` that differ in γ alone, or in the highest
    harmonic alone.
    """
    done = [line for line in lines if line.run.method == "sharp" and not line.measured.note]
    found = []
    for top in sorted({_top(line) for line in done}):
        series = [line for line in done if _top(line) == top]
        sizes = [line.measured.patches for line in series]
        found += _exponent(f"m to {top}", "patches", sizes, series)
    for gamma in sorted({line.run.scene.work_of_adhesion for line in done}, reverse=True):
        series = [line for line in done if line.run.scene.work_of_adhesion == gamma]
        found += _exponent(f"γ = {gamma:g}", "wave numbers", [_top(s) for s in series], series)
    return found


def _top(line: Line) -> int:
    return line.run.scene.n0 * line.run.scene.ratio


def _exponent(
    among: str, variable: str, sizes: Sequence[int], series: Sequence[Line]
) -> list[Exponent]:
    if len(set(sizes)) < 2:
        return []
    seconds = np.array([line.measured.cpu_seconds for line in series])
    solutions = np.array([line.measured.solutions for line in series])
    of_loop, of_solution = (
        float(np.polyfit(np.log(sizes), np.log(cost), 1)[0])
        for cost in (seconds, seconds / solutions)
    )
    return [Exponent(among, variable, min(sizes), max(sizes), of_loop, of_solution)]


def ratios(lines: Sequence[Line]) -> list[Ratio]:
    """Compare every finished run of ``sharp`` with the ``grid`` of its scene; see :class:`Ratio`.

    Both methods must have finished; a scene without grid gives none.
    """
    found = []
    for line in lines:
        if line.run.method != "sharp" or not math.isfinite(line.error):
            continue
        series = [
            (abs(other.error), other.measured.cpu_seconds)
            for other in lines
            if other.run.scene is line.run.scene
            and other.run.method == "grid"
            and math.isfinite(other.error)
        ]
        if series:
            kept, lucky = _quotient(line, _kept(series)), _quotient(line, series)
            found.append(Ratio(line, kept, lucky))
    return found


def _quotient(line: Line, series: Sequence[tuple[float, float]]) -> Quotient:
    front = _front(series)
    errors, seconds = (np.array(column) for column in zip(*front, strict=True))
    own = line.measured.cpu_seconds
    error = max(abs(line.error), 1e-300)
    if error < errors[-1]:
        return Quotient(float(seconds[-1] / own), ">")
    if error > errors[0]:
        return Quotient(float(seconds[0] / own), "<")
    at_equal_error = np.interp(-np.log(error), -np.log(errors), np.log(seconds))
    return Quotient(float(np.exp(at_equal_error) / own), "")


def _kept(series: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Runs (error, seconds), coarse to fine, each with the largest error of it and finer ones."""
    kept: list[tuple[float, float]] = []
    for error, seconds in reversed(series):
        kept.append((max(error, kept[-1][0]) if kept else error, seconds))
    return kept[::-1]


def _front(series: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Runs (error, seconds) that no cheaper run beats in error; errors fall along the list."""
    front: list[tuple[float, float]] = []
    for error, seconds in sorted(series, key=lambda pair: pair[1]):
        if not front or error < front[-1][0]:
            front.append((max(error, 1e-300), seconds))
    return front


def _runs(scene: Scene, seconds: float) -> Iterator[Run]:
    settings: list[tuple[Measured, Sequence[float]]] = [
        ("grid", scene.grids),
        ("sharp", scene.accuracies),
    ]
    if has_tamaas():
        settings.append(("tamaas", scene.ranges))
    for method, values in settings:
        finer = _TAMAAS_STEPS.get(scene.name, 1) if method == "tamaas" else 1
        for value in values:
            yield Run(scene, method, value, scene.load_steps * finer, seconds)


def _left_out(run: Run, before: Sequence[Line]) -> Measurement | None:
    """Measurement of a grid run that would take too long; None if it should be tried."""
    if run.method != "grid" or not before:
        return None
    last = before[-1].measured.cpu_seconds  # NaN if that one did not finish either
    if last * _NEXT_GRID <= run.seconds:
        return None
    return Measurement(note=f"left out: it would take more than {run.seconds:g} s")


def _fill_caches() -> None:
    """Compile what is kept on disk: a compiler in the process would count as its memory."""
    measure(Run(WARM_UP, "sharp", 1e-2, WARM_UP.load_steps, 60.0))


def _reference(scene: Scene, seconds: float) -> Reference:
    if scene.exact_loss is not None:
        return Reference(scene.exact_loss, "closed form")
    for accuracy in scene.tightest:
        patience = _REFERENCE_PATIENCE * seconds
        run = Run(scene, "sharp", accuracy, scene.reference_load_steps, patience)
        loss = measure(run).loss
        if math.isfinite(loss):
            text = f"sharp, accuracy {run.described}, {run.load_steps} load steps"
            return Reference(loss, text)
    return Reference(math.nan, "none: no reference run finished")
