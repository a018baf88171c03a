"""Compare CPU time and memory of every method at equal error in the loss.

On every scene (:mod:`adhesis.ensemble.bench.scenes`) each method runs the same loop at several
resolutions, every run in a process of its own (:mod:`adhesis.ensemble.bench.measure`). Errors are
those of the loop integral, relative to the closed form or to a reference run of ``sharp`` that is
more accurate than every measured one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from adhesis.ensemble.bench.measure import Measurement, Run, measure
from adhesis.ensemble.bench.scenes import FULL, Scene
from adhesis.solver.registry import MethodName

# Doubling the nodes multiplies the time of a grid run by up to this factor.
_COST_OF_DOUBLING = 4.0
# Time limit of the reference run, in units of that of a measured run.
_REFERENCE_LIMIT = 3.0
_BOUNDS = {">": "over ", "<": "under ", "": ""}


@dataclass(frozen=True)
class Reference:
    """Loss to which errors refer, in J/m², and its origin."""

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

    ``bound`` is "" if the error lies within the series of grids (interpolated, log-log), ">" if no
    grid run is as accurate (``value`` is then the ratio to the most accurate one, and a lower
    bound), "<" if the cheapest grid run is more accurate (an upper bound).
    """

    value: float
    bound: str

    def __str__(self) -> str:
        return f"{_BOUNDS[self.bound]}{self.value:.2g}"


@dataclass(frozen=True)
class Ratio:
    """CPU time of ``grid`` over that of one run of ``sharp``, at the error of the latter.

    The errors of ``grid`` come from single jumps and change their sign from one number of nodes to
    the next: a coarse grid can be accurate by chance, which only a reference shows.
    """

    line: Line
    # Ratio to the coarsest grid that is at least as accurate, as are all finer ones that finished
    converged: Quotient
    cheapest: Quotient  # ratio to the cheapest grid that is at least as accurate, perhaps by chance


def benchmark(scenes: Sequence[Scene] = FULL, *, seconds: float = 360.0) -> Iterator[Line]:
    """Measure the methods on the scenes, one line after the other.

    A run is given up after so many CPU seconds. A grid that would take longer, estimated from the
    one before it, is left out. Both give lines with a note.
    """
    for scene in scenes:
        reference, before = _reference(scene, seconds), 0.0
        for run in _runs(scene, seconds):
            line = Line(run, reference, _left_out(run, before) or measure(run))
            before = line.measured.cpu_seconds  # NaN if the run did not finish
            yield line


def ratios(lines: Sequence[Line]) -> list[Ratio]:
    """Compare every finished run of ``sharp`` with the ``grid`` of its scene; see :class:`Ratio`.

    Both methods must have finished; a scene without grid gives none.
    """
    found = []
    finished = [line for line in lines if math.isfinite(line.error)]
    for line in finished:
        here = [other for other in finished if other.run.scene is line.run.scene]
        grids = [other for other in here if other.run.method == "grid"]
        if line.run.method == "sharp" and grids:
            series = [(abs(grid.error), grid.measured.cpu_seconds) for grid in grids]
            converged = _quotient(line, _with_error_of_finer(series))
            found.append(Ratio(line, converged, _quotient(line, series)))
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


def _with_error_of_finer(series: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Replace each error of runs (error, seconds), coarse to fine, by the largest from there on."""
    errors, seconds = zip(*reversed(series), strict=True)
    return list(zip(accumulate(errors, max), seconds, strict=True))[::-1]


def _front(series: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Select the runs (error, seconds) that no cheaper run beats; errors fall along the list."""
    front: list[tuple[float, float]] = []
    for error, seconds in sorted(series, key=lambda pair: pair[1]):
        if not front or error < front[-1][0]:
            front.append((max(error, 1e-300), seconds))
    return front


def _runs(scene: Scene, seconds: float) -> Iterator[Run]:
    settings: dict[MethodName, tuple[float, ...]] = {
        "grid": scene.grids,
        "sharp": scene.accuracies,
    }
    for method, values in settings.items():
        for value in values:
            yield Run(scene, method, value, scene.load_steps, seconds)


def _left_out(run: Run, before: float) -> Measurement | None:
    """Return a note for a grid run that would take too long; None if it should be tried."""
    if run.method != "grid" or before * _COST_OF_DOUBLING <= run.seconds:
        return None
    return Measurement(note=f"left out: it would take more than {run.seconds:g} s")


def _reference(scene: Scene, seconds: float) -> Reference:
    if scene.exact_loss is not None:
        return Reference(scene.exact_loss, "closed form")
    for accuracy in scene.tightest:
        limit = _REFERENCE_LIMIT * seconds
        run = Run(scene, "sharp", accuracy, scene.reference_load_steps, limit)
        loss = measure(run).loss
        if math.isfinite(loss):
            text = f"sharp, accuracy {run.described}, {run.load_steps} load steps"
            return Reference(loss, text)
    return Reference(math.nan, "none: no reference run finished")
