"""The loading path: one complete loading-unloading loop, its losses and its energy audit.

dU/ds = -λ p̄ at equilibrium, so over a closed loop the loop integral of the mean stress and the sum
of the energy drops at the jumps are the same energy. They are computed independently of each other
(stresses against energies), and their difference is the audit of the loop.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from time import process_time

import numpy as np
from numpy.typing import NDArray

from solver.control import Control
from solver.jumps import Branch, Jump
from solver.method import ContactState, Method, MethodReport, Path, PathError
from solver.problem import Problem
from solver.profile import Array

Progress = Callable[[Branch, float, ContactState], None]
"""Called after each load step with branch, penetration Δ/h_max and state; may raise to stop."""

# Unloading has always detached long before this many times the loading stroke; more is a bug.
_MAX_UNLOADING_STROKES = 1000


@dataclass(frozen=True, eq=False)
class LoopResult:
    """A complete loop; arrays have the shape (states,), in the order of the path.

    Attributes
    ----------
    problem : Problem
    turning_point : float
        What was asked for at the turning point: Δ/h_max, u_tot/h_max where a stiffness holds the
        half-space, p̄ in Pa under a load.
    max_penetration : float
        Δ/h_max at the turning point: as asked for, or where the control does not fix it, as found.
    load_steps : int
        Equal steps of the loading branch.
    branch : array of str, shape (states,)
        "loading" or "unloading".
    load_step : bool array
        True at the states on the uniform axis of load steps, False at those that the method added
        in between (before and after jumps, and where the curve bends).
    penetration : array
        Δ/h_max.
    separation : array
        s in m.
    mean_stress : array
        p̄ in Pa, compression positive.
    contact_fraction : array
        A/A0.
    patches : int array
    elastic_energy, adhesion_energy : array
        In J/m, per period.
    jumps : tuple of Jump
    loss : float
        ∮ p̄ dΔ in J/m² of nominal area, over all states (:func:`integral`; :mod:`solver.control`).
    loss_dimensionless : float
        W~ = ∮ σ~ dΔ~ with Δ~ = Δ/h_max and σ~ = 2p̄/(E* q0 h_max).
    loss_from_drops : float
        Sum of the energy drops at the jumps, in J/m².
    loss_error : float
        Estimated numerical error of the loss, in J/m².
    seconds : float
        CPU time of this process, in s.
    method : MethodReport
        What the method says of itself (name, resolution, counters).

    References
    ----------
    docs/theory.md, "3. The loop"
    """

    problem: Problem = field(repr=False)
    turning_point: float
    max_penetration: float
    load_steps: int
    branch: NDArray[np.str_]
    load_step: NDArray[np.bool_]
    penetration: Array
    separation: Array
    mean_stress: Array
    contact_fraction: Array
    patches: NDArray[np.int64]
    elastic_energy: Array
    adhesion_energy: Array
    jumps: tuple[Jump, ...]
    loss: float
    loss_dimensionless: float
    loss_from_drops: float
    loss_error: float
    seconds: float
    method: MethodReport

    @property
    def energy(self) -> Array:
        """U in J/m, per period, shape (states,)."""
        return self.elastic_energy + self.adhesion_energy

    @property
    def audit_residual(self) -> float:
        """(loop integral - sum of drops) / loop integral; 0 for a loop without loss."""
        return (self.loss - self.loss_from_drops) / self.loss if self.loss else 0.0

    @property
    def races(self) -> int:
        """Number of jumps that another rule of descent would have ended elsewhere."""
        return sum(jump.raced for jump in self.jumps)

    @property
    def energy_at_stake(self) -> float:
        """Sum over the jumps of the energy that depends on the rule of descent, in J/m²."""
        return float(sum(jump.at_stake for jump in self.jumps))

    @property
    def pull_off_penetration(self) -> float:
        """Δ/h_max of the state that has lost all contact."""
        return float(self.penetration[-1])

    @property
    def pull_off_stress(self) -> float:
        """Largest mean tension on unloading, -min p̄, in Pa."""
        return float(-self.mean_stress[self.branch == "unloading"].min())

    def __str__(self) -> str:
        """A few lines for a terminal: what was followed, its losses, its jumps, its pull-off."""
        profile = self.problem.profile
        kinds = Counter(jump.kind for jump in self.jumps)
        several = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
        return "\n".join(
            (
                f"profile    h_max = {profile.h_max:.4g} m, m2 = {profile.m2:.4g}, "
                f"period {profile.period:.4g} m",
                f"loop       γ = {self.problem.work_of_adhesion:.4g} J/m², "
                f"Δ/h_max up to {self.max_penetration:.4g} in {self.load_steps} load steps, "
                f"method {self.method.name}",
                f"loss       {self.loss:.5g} J/m² (W~ = {self.loss_dimensionless:.5g}); "
                f"sum of drops {self.loss_from_drops:.5g} J/m²",
                f"jumps      {len(self.jumps)}{f' ({several})' if several else ''}",
                f"pull-off   {self.pull_off_stress:.4g} Pa, "
                f"out of contact at Δ/h_max = {self.pull_off_penetration:.4g}",
                f"states     {len(self.separation)}, {self.seconds:.2g} s of CPU time",
            )
        )

    def states(self, branch: Branch, load_steps_only: bool = False) -> NDArray[np.intp]:
        """Indices of the states of one branch, optionally only those on the load-step axis."""
        chosen = self.branch == branch
        return np.flatnonzero(chosen & self.load_step if load_steps_only else chosen)


def integral(prescribed: Array, conjugate: Array, stiffness: Array) -> float:
    """∫ Y dx over the states, in J/m²: trapezoidal rule, end-corrected where dY/dx is known.

    At fixed separation that is ∫ p̄ ds. The correction h²/12 (Y'_0 - Y'_1) raises the order from two
    to four on smooth pieces; it is left out where a stiffness is NaN.

    Parameters
    ----------
    prescribed, conjugate, stiffness : array, shape (states,)
        x, Y and dY/dx (:mod:`solver.control`; m, Pa and Pa/m, or Pa, m and m/Pa), in the order of
        the path.
    """
    bend = -np.diff(stiffness) * np.diff(prescribed) ** 2 / 12
    return float(np.trapezoid(conjugate, prescribed)) + float(np.nansum(bend))


def check_cycle(turning_point: float, load_steps: int, control: Control | None = None) -> None:
    """Refuse a cycle that cannot be run.

    Raises
    ------
    ValueError
        Unless the turning point is positive and finite and, at fixed separation, below 1, and
        load_steps is a whole number of at least 1.
    """
    control = control or Control()
    sound = bool(np.isfinite(turning_point)) and turning_point > 0
    if control.is_fixed and not (sound and turning_point < 1):
        raise ValueError(
            f"max_penetration is {turning_point!r}: it must lie between 0 and 1, both excluded "
            "(in units of h_max; at 1 the mean gap would be zero, and no such state exists)"
        )
    if not sound:
        name, unit = ("max_stress", "Pa") if control.is_load else ("max_penetration", "h_max")
        raise ValueError(
            f"{name} is {turning_point!r}: it must be positive and finite, in units of {unit}"
        )
    if load_steps != int(load_steps) or load_steps < 1:
        raise ValueError(f"load_steps is {load_steps!r}: it must be a whole number of at least 1")


@dataclass
class Record:
    """The states of a path in order, each with its branch, and the jumps between them.

    Parameters
    ----------
    on_state : callable, optional
        Called with every state of the path, in order.
    """

    on_state: Callable[[Branch, ContactState], None] | None = None
    branches: list[Branch] = field(default_factory=list)
    on_axis: list[bool] = field(default_factory=list)
    states: list[ContactState] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    error: float = 0.0
    """Sum of what the method knows of its own error, in J/m²; NaN if it does not know."""

    def visit(self, branch: Branch, on_axis: bool, state: ContactState) -> None:
        """Take down one state; ``on_axis`` if it ends a load step."""
        self.branches.append(branch)
        self.on_axis.append(on_axis)
        self.states.append(state)
        if self.on_state is not None:
            self.on_state(branch, state)

    def extend(self, branch: Branch, path: Path) -> ContactState:
        """Take down one load step, whose last state lies on the axis; return that state."""
        for passed in path.states[:-1]:
            self.visit(branch, False, passed)
        self.visit(branch, True, path.states[-1])
        self.jumps += path.jumps
        self.error += path.error
        return path.states[-1]

    def column(self, name: str) -> Array:
        """One attribute of every state, shape (states,)."""
        return np.array([getattr(state, name) for state in self.states])


def run_loop(
    method: Method,
    *,
    max_penetration: float | None = None,
    max_stress: float | None = None,
    load_steps: int,
    progress: Progress | None = None,
    on_state: Callable[[Branch, ContactState], None] | None = None,
) -> LoopResult:
    """Load from first touch to the turning point, then unload until detached.

    Parameters
    ----------
    method : Method
    max_penetration : float
        Δ~max = Δ/h_max, 0 < Δ~max < 1; where a stiffness holds the half-space u_tot/h_max.
    max_stress : float
        Under a load, instead: p̄ in Pa, positive.
    load_steps : int
        Equal steps of the loading branch; unloading goes on with the same step.
    progress : callable, optional
        See :data:`Progress`.
    on_state : callable, optional
        Called with every state of the path, in order (for fields at chosen penetrations).

    Raises
    ------
    ValueError
        If the cycle cannot be run (:func:`check_cycle`).
    PathError
        If the path cannot be followed, or the contact has not detached after a thousand loading
        strokes.

    References
    ----------
    docs/theory.md, "3. The loop"
    """
    turning_point = _turning_point(method.problem, max_penetration, max_stress)
    check_cycle(turning_point, load_steps, method.problem.control)
    started = process_time()
    record = Record(on_state)
    for branch, index, state in _steps(method, record, turning_point, load_steps):
        if progress is not None:
            progress(branch, turning_point * index / load_steps, state)
    return _result(method, record, turning_point, load_steps, started)


def _turning_point(
    problem: Problem, max_penetration: float | None, max_stress: float | None
) -> float:
    """The turning point that belongs to the control.

    Raises
    ------
    ValueError
        If the other one is given, or none.
    """
    wanted, other = ("max_penetration", max_penetration), ("max_stress", max_stress)
    if problem.control.is_load:
        wanted, other = other, wanted
    if wanted[1] is None or other[1] is not None:
        held = "a load" if problem.control.is_load else "a separation or a stiffness"
        raise ValueError(f"a path under {held} turns at {wanted[0]}: give that, and no {other[0]}")
    return wanted[1]


def _steps(
    method: Method, record: Record, turning_point: float, load_steps: int
) -> Iterator[tuple[Branch, int, ContactState]]:
    """Go through the load steps of a loop; gives branch, place on the axis and state of each."""
    problem = method.problem

    def prescribed(index: int) -> float:
        return problem.prescribed(turning_point * index / load_steps)

    state = method.detached(problem.profile.h_max)
    record.visit("loading", False, state)
    for i in range(load_steps + 1):
        state = record.extend("loading", method.follow(state, prescribed(i)))
        yield "loading", i, state
    # The turning point belongs to both branches: it starts the unloading curve.
    record.visit("unloading", True, state)
    i = load_steps
    while state.patches:
        i -= 1
        if load_steps - i > _MAX_UNLOADING_STROKES * load_steps:
            raise PathError(f"still in contact at {turning_point * i / load_steps:g}")
        state = record.extend("unloading", method.follow(state, prescribed(i)))
        yield "unloading", i, state


def _result(
    method: Method, record: Record, turning_point: float, load_steps: int, started: float
) -> LoopResult:
    """The loop of a record; ``started`` is the CPU time at which it was begun, in s."""
    problem = method.problem
    separation = record.column("separation")
    mean_stress = record.column("mean_stress")
    control, h_max = problem.control, problem.profile.h_max
    loss = -integral(
        control.prescribed(separation, mean_stress),
        control.conjugate(separation, mean_stress, h_max),
        record.column("stiffness"),
    )
    max_penetration = turning_point
    if not control.is_fixed:
        turn = record.branches.index("unloading")
        max_penetration = problem.penetration(separation[turn])
    drops = float(sum(jump.energy_drop for jump in record.jumps))
    return LoopResult(
        problem=problem,
        turning_point=turning_point,
        max_penetration=max_penetration,
        load_steps=load_steps,
        branch=np.array(record.branches),
        load_step=np.array(record.on_axis),
        penetration=1.0 - separation / problem.profile.h_max,
        separation=separation,
        mean_stress=mean_stress,
        contact_fraction=record.column("contact_fraction"),
        patches=record.column("patches").astype(np.int64),
        elastic_energy=record.column("elastic_energy"),
        adhesion_energy=record.column("adhesion_energy"),
        jumps=tuple(record.jumps),
        loss=loss,
        loss_dimensionless=loss / problem.loss_scale,
        loss_from_drops=drops,
        loss_error=_loss_error(loss, drops, record),
        seconds=process_time() - started,
        method=method.report(),
    )


def _loss_error(loss: float, drops: float, record: Record) -> float:
    """Estimated error of the loss in J/m²: the method's own, or failing that a part in a hundred.

    On top of either comes what the audit sees.
    """
    own = record.error if np.isfinite(record.error) else 0.01 * abs(drops)
    return own + abs(loss - drops)
