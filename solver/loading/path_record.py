"""Record the states and jumps of a path in order, and compute the work along it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.method import ContactState, Path, PathError
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array

_NEAR = 1e-9  # in load steps: closer values are equal but for rounding


@dataclass(frozen=True)
class Axis:
    """Equal load steps from 0, ``load_steps`` of them up to ``top``."""

    top: float
    load_steps: int

    def __call__(self, index: int) -> float:
        """Return the prescribed value of a load step, exactly ``top`` for the last one."""
        return self.top if index == self.load_steps else self.top * index / self.load_steps

    @property
    def step(self) -> float:
        """One load step."""
        return self.top / self.load_steps

    @property
    def near(self) -> float:
        """Distance within which two values are equal but for rounding."""
        return _NEAR * self.step

    def above(self, drive: float) -> int:
        """Return the index of the first load step at or above ``drive``."""
        return math.ceil(drive * self.load_steps / self.top - _NEAR)

    def apart(self, values: Sequence[float], others: Sequence[float] = ()) -> list[float]:
        """Return the distinct values, sorted, that are neither load steps nor among the others."""
        found: list[float] = []
        for value in sorted(values):
            step = self(round(value * self.load_steps / self.top))
            if all(abs(value - other) > self.near for other in (step, *others, *found[-1:])):
                found.append(value)
        return found

    def between(self, start: float, end: float, marks: Sequence[float] = ()) -> list[float]:
        """Return the load steps from ``start`` to ``end``, both included, and the marks between.

        A mark or an end replaces a load step within rounding of it.
        """
        low, high = min(start, end), max(start, end)
        kept = sorted({low, high, *(m for m in marks if low < m < high)})
        grid = (self(k) for k in range(self.above(low), self.above(high)))
        values = sorted([*kept, *(p for p in grid if min(abs(p - k) for k in kept) > self.near)])
        return values if start <= end else values[::-1]


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
    """Sum of the method's estimates of its error, in J/m²; NaN if it has none."""

    def visit(self, branch: Branch, on_axis: bool, state: ContactState) -> None:
        """Append one state; ``on_axis`` if it ends a load step."""
        self.branches.append(branch)
        self.on_axis.append(on_axis)
        self.states.append(state)
        if self.on_state is not None:
            self.on_state(branch, state)

    def extend(self, branch: Branch, path: Path) -> ContactState:
        """Append the states of one load step and return the last one, which lies on the axis."""
        for between in path.states[:-1]:
            self.visit(branch, False, between)
        self.visit(branch, True, path.states[-1])
        self.jumps += path.jumps
        self.error += path.error
        return path.states[-1]

    def column(self, name: str) -> Array:
        """Return one attribute of every state, shape (states,)."""
        return np.array([getattr(state, name) for state in self.states])

    def before_jumps(self) -> list[int]:
        """Return the index of the state before each jump; the next one is that after it."""
        separation, contact = self.column("separation"), self.column("contact_fraction")
        return states_before_jumps(self.jumps, self.branches, separation, contact)

    def slice(self, first: int, stop: int | None = None, jumps: Sequence[Jump] = ()) -> Record:
        """Return a record of the states from index ``first`` up to ``stop``, and of their jumps."""
        part = slice(first, stop)
        return Record(
            branches=self.branches[part],
            on_axis=self.on_axis[part],
            states=self.states[part],
            jumps=list(jumps),
        )

    def copy(self) -> Record:
        """Return a copy with lists of its own."""
        copied = replace(self, branches=[*self.branches], on_axis=[*self.on_axis])
        copied.states, copied.jumps = [*self.states], [*self.jumps]
        return copied

    def dissipated(self, problem: Problem) -> float:
        """Sum the energy drops at the jumps, and the friction of edges between them, in J/m²."""
        friction = self.column("edge_friction")
        if not friction.any():
            return dissipated(problem, self.jumps, (), None)
        return dissipated(problem, self.jumps, self.before_jumps(), friction)

    def work(self, problem: Problem) -> float:
        """Compute the work of the driving device, -∫ Y dx over the states, in J/m².

        x and Y are those of :mod:`adhesis.solver.model.control`.

        Raises
        ------
        PathError
            If a state without contact lies below s = h_max, where surfaces overlap. Not raised
            without adhesion, where methods may leave out patches that they do not resolve.
        """
        control, h_max = problem.control, problem.profile.h_max
        separation, mean_stress = self.column("separation"), self.column("mean_stress")
        free = separation[self.column("patches") == 0]
        must_touch = not control.is_load and problem.work_of_adhesion > 0
        if must_touch and free.min(initial=np.inf) < h_max * (1 - _NEAR):
            raise PathError(
                f"the path is without contact at s = {free.min() / h_max:.9g} h_max "
                f"({free.min():.9g} m), where surfaces overlap: there is no such state"
            )
        return -integral(
            control.prescribed(separation, mean_stress),
            control.conjugate(separation, mean_stress, h_max),
            self.column("stiffness"),
        )


def states_before_jumps(
    jumps: Sequence[Jump],
    branch: Sequence[str] | NDArray[np.str_],
    separation: Array,
    contact: Array,
) -> list[int]:
    """Return the index of the state before each jump of a path; the next one is that after it.

    ``contact`` is A/A0; it, the branch and the separation have the shape (states,).
    """
    before = (np.asarray(column).tolist() for column in (branch, separation, contact))
    pairs = list(zip(*before, np.asarray(contact)[1:].tolist(), strict=False))
    found = [0]
    for jump in jumps:
        wanted = (jump.branch, jump.separation, jump.contact_before, jump.contact_after)
        found.append(
            next((k for k in range(found[-1], len(pairs)) if pairs[k] == wanted), len(pairs) - 1)
        )
    return found[1:]


def dissipated(
    problem: Problem,
    jumps: Sequence[Jump],
    before: Sequence[int],
    edge_friction: Array | None,
) -> float:
    """Sum the energy drops at jumps, and the friction of edges between them, in J/m².

    Parameters
    ----------
    problem : Problem
    jumps : sequence of Jump
    before : sequence of int
        Index of the state before each jump; not needed without friction.
    edge_friction : array, shape (states,), optional
        Energy in J/m that receding edges have dissipated so far; None if there is none.
    """
    drops = float(sum(jump.energy_drop for jump in jumps))
    if edge_friction is None:
        return drops
    in_jumps = sum(edge_friction[i + 1] - edge_friction[i] for i in before)
    return drops + float(edge_friction[-1] - edge_friction[0] - in_jumps) / problem.profile.period


def integral(prescribed: Array, conjugate: Array, stiffness: Array) -> float:
    """Compute ∫ Y dx over the states, in J/m², by the end-corrected trapezoidal rule.

    At fixed separation that is ∫ p̄ ds. The correction h²/12 (Y'_0 - Y'_1) raises the order from two
    to four on smooth pieces; it is omitted where a stiffness is NaN.

    Parameters
    ----------
    prescribed, conjugate, stiffness : array, shape (states,)
        x, Y and dY/dx (:mod:`adhesis.solver.model.control`; m, Pa and Pa/m, or Pa, m and m/Pa), in
        the order of the path.
    """
    correction = -np.diff(stiffness) * np.diff(prescribed) ** 2 / 12
    return float(np.trapezoid(conjugate, prescribed)) + float(np.nansum(correction))
