"""Run a method on the problems of the closed forms and compare: rows of (claim, error, bound).

The bounds follow from the resolution e of an edge: dx for ``grid``, whose edges lie on nodes,
1e-6 λ for ``sharp`` (energies are stationary in the edges, so its losses are far better). The error
of a half-width may be e, that of the mean stress the change of the closed form when its half-width
changes by e at the same s. A stress compared at a *given* width has the error of a width known to
e, at which Griffith's criterion holds within e.

The waves are so shallow (A q0 = 6e-6) that the flat and the arc measure of the adhesive area
(``single_wave``) agree to 3e-11.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.method import Method
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array, single_wave
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.registry import MethodName, make_method

ALPHAS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
STIFFNESSES = (10.0, 1.0, 0.1, 0.0)  # of the control, in p*/A; 0 is a load
GRIDS = (256, 512, 1024, 2048, 4096)
AMPLITUDE, PERIOD = 1e-9, 1e-3
HALF_SPACE = HalfSpace(young=1e6, poisson=0.5)
MODULUS = HALF_SPACE.modulus


@dataclass(frozen=True)
class Row:
    """One claim with its error and bound.

    Attributes
    ----------
    claim, method, resolution : str
    error, bound : float
        Not negative; in the units of the claim, else relative. NaN if the method raised an error.
    note : str
        Further measurements, or the reason why there is no error.
    """

    claim: str
    method: str
    resolution: str
    error: float
    bound: float
    note: str = ""

    @property
    def passed(self) -> bool:
        """True if the error is within the bound."""
        return self.error <= self.bound


@dataclass(frozen=True)
class Standard:
    """Settings of a method here, and its stated errors.

    Attributes
    ----------
    accuracy : float
    nodes : int or None
        Settings; None for a method without a grid.
    edge : float
        Resolution e of an edge as a part of λ.
    stress : float
        Relative error of the elastic solution between given edges.
    loss, loop_integral : float
        Relative error of the loss from the sum of drops, and from the trapezoidal rule.
    """

    accuracy: float
    nodes: int | None
    edge: float
    stress: float
    loss: float
    loop_integral: float

    @property
    def resolution(self) -> str:
        """Resolution in the table's words."""
        return f"{self.nodes} nodes" if self.nodes else f"accuracy {self.accuracy:g}"


STANDARDS: dict[MethodName, Standard] = {
    "grid": Standard(1e-4, GRIDS[-1], 1 / GRIDS[-1], 1e-6, loss=5e-3, loop_integral=5e-3),
    "sharp": Standard(1e-8, None, 1e-6, 1e-9, loss=1e-8, loop_integral=1e-5),
}
METHODS: tuple[MethodName, ...] = tuple(STANDARDS)


class Judge:
    """Comparison of one method with the closed forms.

    Parameters
    ----------
    name : str
        Of :data:`METHODS`.
    """

    def __init__(self, name: MethodName) -> None:
        self.name = name
        self.standard = STANDARDS[name]
        self._loops: dict[float, tuple[SingleWave, LoopResult]] = {}

    def method(self, problem: Problem, nodes: int | None = None) -> Method:
        """Make the method for ``problem``, by default with the standard's number of nodes."""
        nodes = nodes or self.standard.nodes
        per_wave = nodes // problem.profile.highest_harmonic if nodes else None
        return make_method(
            self.name, problem, accuracy=self.standard.accuracy, nodes_per_wave=per_wave
        )

    def row(
        self, claim: str, error: float, bound: float, note: str = "", resolution: str = ""
    ) -> Row:
        """Make one row, with the absolute value of the error."""
        where = resolution or self.standard.resolution
        return Row(claim, self.name, where, abs(float(error)), float(bound), note)

    def losses(
        self, claim: str, result: LoopResult, exact: float, late: float = 0.0
    ) -> Iterator[Row]:
        """Make the rows of both losses of a loop; ``late`` adds to the relative bound."""
        for what, value, bound in (
            ("sum of drops", result.loss_from_drops, self.standard.loss),
            ("loop integral", result.loss, self.standard.loop_integral),
        ):
            yield self.row(f"{claim}, {what}", value / exact - 1, bound + late)

    def worst(self, claim: str, errors: Array, bounds: Array, note: str = "") -> Row:
        """Make the row of the state with the largest ratio of error to bound.

        Raises
        ------
        RuntimeError
            If there is no state.
        """
        if errors.size == 0:
            raise RuntimeError("no state in contact was found")
        bounds = np.broadcast_to(bounds, errors.shape)
        k = int(np.argmax(np.abs(errors) / bounds))
        return self.row(claim, errors[k], bounds[k], note)

    def wave_loop(self, alpha: float) -> tuple[SingleWave, LoopResult]:
        """Return the closed form at α and the method's loop.

        The loss does not depend on the turning point. Beyond a penetration of 2α adhesion is a
        small correction to the wave without it, which ``claims.westergaard`` follows to 0.9.
        """
        if alpha not in self._loops:
            wave = wave_of(alpha)
            method = self.method(problem_of(wave))
            turn = min(0.5, 2 * alpha)
            self._loops[alpha] = (wave, run_loop(method, max_penetration=turn, load_steps=8))
        return self._loops[alpha]

    # ------------------------------------------------------------------ bounds

    def error_of_half_width(
        self, function: Callable[[Array, Array], Array], a: Array, s: Array
    ) -> Array:
        """Compute the change of ``function`` when the half-width changes by e at the same s."""
        step, here = self.standard.edge * PERIOD, function(a, s)
        change = [np.abs(function(a + sign * step, s) - here) for sign in (-1, 1)]
        return np.asarray(np.maximum(*change) + self.standard.stress * np.abs(here))

    def error_at_given_width(self, wave: SingleWave, a: Array, s: Array) -> Array:
        """Bound the error of the mean stress at a half-width known, and balanced, within e."""

        def excess_stress(a: Array) -> Array:
            return wave.mean_stress_at(a, s) - wave.mean_stress(a)

        step = self.standard.edge * PERIOD
        changes = [
            [np.abs(function(a + sign * step) - function(a)) for sign in (-1, 1)]
            for function in (excess_stress, wave.mean_stress)
        ]
        width = np.maximum(*changes[0]) + np.maximum(*changes[1])
        return np.asarray(width + self.standard.stress * wave.full_contact_stress)


def wave_of(alpha: float) -> SingleWave:
    """Return the closed form of the shallow wave at α."""
    return SingleWave.with_alpha(alpha, AMPLITUDE, PERIOD, MODULUS)


def problem_of(wave: SingleWave) -> Problem:
    """Return the problem of a ``wave`` from :func:`wave_of`."""
    return Problem(single_wave(AMPLITUDE, PERIOD), HALF_SPACE, wave.work_of_adhesion)


def joined(pairs: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Concatenate the errors and the bounds of pairs (errors, bounds)."""
    errors, bounds = zip(*pairs, strict=True)
    return np.concatenate(errors), np.concatenate(bounds)
