"""Follow a path load step by load step, and record its states and jumps in order."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Self

import numpy as np

from adhesis.solver import views
from adhesis.solver.checks import function
from adhesis.solver.loading.mean_stress_event import follow_to_stress
from adhesis.solver.method import ContactState, Method, PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.profile import Array

HOW_METHOD = "make_method(name, problem)"
"""Call that makes a method, for error messages."""

Progress = Callable[[Branch, float, ContactState], None]
"""Called after each load step with branch, drive and state; may raise to stop.

The drive is u_tot/h_max, at fixed separation the penetration Δ/h_max; under a load Pa."""

OnState = Callable[[Branch, ContactState], None]
"""Called with every state of a path, in order."""

_NEAR = 1e-9  # in load steps: closer values are equal but for rounding
# Beyond this multiple of the loading range, unloading takes longer steps: of the given share of the
# control's natural range (h_max at fixed separation) or of the distance from first touch. Loops of
# ordinary depth detach long before.
_STROKES_AT_STEP = 20
_LONG_STEP = 0.02
# Unloading stops with an error this many natural ranges below first touch. Contact detaches at
# about sqrt(γ/energy of full contact) ranges, and methods accept γ up to 1e12 of those energies.
_FARTHEST = 1e7


@contextmanager
def progress_of(
    progress: Progress | bool | None, top: float, control: Control
) -> Iterator[Progress | None]:
    """Return the function to call after each load step: the given one, or for True a bar's.

    That is full at the largest turning point, ``top``. TypeError if ``progress`` is neither.
    """
    if progress is True:
        with views.maker().progress_bar(top, control.is_load) as bar:
            yield bar
    elif progress is False:
        yield None
    else:
        yield function("progress", progress)


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


class Record:
    """A path that is followed: its states in order, each with its branch, and the jumps.

    ``progress`` is called with every load step before it is recorded; if it raises, the record is
    unchanged.

    Attributes
    ----------
    state : ContactState
        The last one; out of contact at first.
    drive : float
        Prescribed value there: Δ/h_max, u_tot/h_max or Pa.
    branches, ends_load_step, legs, states : list
        Of every state its branch, whether it ends a load step, and the number of its leg.
    jumps : list of Jump
    error : float
        Sum of the method's estimates of its error, in J/m²; NaN if it has none.
    """

    def __init__(self, method: Method, axis: Axis) -> None:
        self.method, self.problem, self.axis = method, method.problem, axis
        self.on_state: OnState | None = None
        self.progress: Progress | None = None
        self.branches: list[Branch] = []
        self.ends_load_step: list[bool] = []
        self.legs: list[int] = []
        self.states: list[ContactState] = []
        self.jumps: list[Jump] = []
        self.error = 0.0
        self.leg, self.drive = -1, 0.0
        self.state = method.detached(method.problem.first_touch)

    def begin(self, branch: Branch) -> None:
        """Begin a leg: the state at the turning point belongs to both."""
        self.leg += 1
        self.branch: Branch = branch
        self.visit(self.leg > 0, self.state)

    def visit(self, ends_load_step: bool, state: ContactState) -> None:
        """Append one state, and whether it ends a load step."""
        self.branches.append(self.branch)
        self.ends_load_step.append(ends_load_step)
        self.legs.append(self.leg)
        self.states.append(state)
        if self.on_state is not None:
            self.on_state(self.branch, state)

    def step(self, drive: float, preload: float | None = None) -> bool:
        """Follow one load step to ``drive``, or up to the preload in Pa; return whether that is.

        Raises
        ------
        PathError
            If the path cannot be followed.
        """
        prescribed, reached = self.problem.prescribed(drive), False
        if preload is None:
            path = self.method.follow(self.state, prescribed)
        else:
            path, reached = follow_to_stress(self.method, self.state, prescribed, preload)
        *between, last = path.states
        if reached:
            drive = self.problem.penetration(self.problem.prescribed_in(last))
        if self.progress is not None:
            self.progress(self.branch, drive, last)
        for state in between:
            self.visit(False, state)
        self.visit(True, last)
        self.jumps += path.jumps
        self.error += path.error
        self.state, self.drive = last, drive
        return reached

    def unload(self, marks: Sequence[float] = ()) -> None:
        """Unload by load steps until contact is lost.

        Parameters
        ----------
        marks : sequence of float
            Further values at which a step ends; those above the turning point are ignored. A mark
            replaces a load step within rounding of it.

        Raises
        ------
        PathError
            If the path cannot be followed, or contact is not lost at any plausible separation.
        """
        problem, axis = self.problem, self.axis
        ahead = sorted(mark for mark in marks if mark < self.drive)
        self.begin("unloading")
        first = i = axis.above(self.drive)
        stride = 1
        unit = problem.prescribed_range
        if not problem.control.is_load:
            unit /= problem.profile.h_max
        while self.state.patches:
            i -= stride
            end = axis(i)
            if end < -_FARTHEST * unit:
                where = problem.describe_prescribed(problem.prescribed(end))
                raise PathError(
                    f"unloading does not end: surfaces are still in contact at {where}, "
                    f"{_FARTHEST:g} times the natural range of the profile; check the units of "
                    "work_of_adhesion, young and the heights, and try another accuracy"
                    f"{problem.or_other_method}"
                )
            if first - i >= _STROKES_AT_STEP * axis.load_steps:
                wanted = _LONG_STEP * max(unit, -end) / axis.step
                stride = max(1, min(2 * stride, int(wanted)))
            stops = []
            while ahead and ahead[-1] > end - axis.near:
                stops.append(ahead.pop())
            if not stops or stops[-1] > end + axis.near:
                stops.append(end)
            for drive in stops:
                self.step(drive)
                if not self.state.patches:
                    break

    def column(self, name: str) -> Array:
        """Return one attribute of every state, shape (states,)."""
        return np.array([getattr(state, name) for state in self.states])

    def copy(self) -> Self:
        """Return a copy with lists of its own."""
        copied = object.__new__(type(self))
        for name, value in self.__dict__.items():
            copied.__dict__[name] = [*value] if isinstance(value, list) else value
        return copied
