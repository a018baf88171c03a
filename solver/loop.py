"""The loading path: one complete loading-unloading loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import process_time
from typing import TypeVar

from solver.checks import (
    FAR_DISPLACEMENT,
    LOAD_STEPS,
    MAX_PENETRATION,
    MAX_STRESS,
    function,
    instance,
    real,
    whole,
)
from solver.control import Control
from solver.jumps import Branch
from solver.loop_result import LoopResult, result_of
from solver.method import ContactState, Method, PathError
from solver.problem import Problem
from solver.record import Axis, Record

T = TypeVar("T")

HOW_METHOD = "make_method(name, problem)"
"""How to make a method, for whoever gives something else."""

Progress = Callable[[Branch, float, ContactState], None]
"""Called after each load step with branch, penetration Δ/h_max and state; may raise to stop."""

# After so many times the loading stroke, unloading skips load steps that are shorter than a share
# of h_max or of the way since first touch; loops of ordinary depth have detached long before.
_STROKES_AT_STEP = 20
_LONG_STEP = 0.02
# Unloading has always detached long before this many times h_max (under a load, this many times the
# loading stroke); more is a bug.
_FARTHEST = 1000
_FARTHEST_HEIGHTS = 1e6


def check_cycle(
    turning_point: float, load_steps: int, control: Control | None = None
) -> tuple[float, int]:
    """Check a cycle; return its turning point and load steps as float and int.

    Raises
    ------
    ValueError
        Unless the turning point is positive and finite and, at fixed separation, below 1, and
        load_steps is a whole number from 1 to 100,000.
    TypeError
        If one of them is no number.
    """
    control = control or Control()
    name, bounds = "max_penetration", FAR_DISPLACEMENT
    if control.is_fixed:
        bounds = MAX_PENETRATION
    elif control.is_load:
        name, bounds = "max_stress", MAX_STRESS
    return real(name, turning_point, bounds), whole("load_steps", load_steps, LOAD_STEPS)


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
    TypeError
        If the method is no Method, or a value no number.
    PathError
        If the path cannot be followed, or the contact has not detached after a thousand loading
        strokes.

    References
    ----------
    docs/theory.md, "3. The loop"
    """
    control = instance("method", method, Method, HOW_METHOD).problem.control
    turning_point = turning_of(method.problem, max_penetration, max_stress)
    turning_point, load_steps = check_cycle(turning_point, load_steps, control)
    function("progress", progress)
    function("on_state", on_state)
    started = process_time()
    record = Record(on_state)
    axis = Axis(turning_point, load_steps)
    state = _load(method, record, [axis(i) for i in range(load_steps + 1)], progress)
    unload(method, record, state, axis, load_steps, progress)
    return result_of(method, record, turning_point, load_steps, started)


def turning_of(problem: Problem, max_penetration: T | None, max_stress: T | None) -> T:
    """The turning point, or points, that belong to the control.

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


def _load(
    method: Method, record: Record, drives: Sequence[float], progress: Progress | None
) -> ContactState:
    """Load from first touch through the load steps ``drives``; gives the state at the last."""
    state = method.detached(method.problem.profile.h_max)
    record.visit("loading", False, state)
    for drive in drives:
        state = record.extend("loading", method.follow(state, method.problem.prescribed(drive)))
        if progress is not None:
            progress("loading", drive, state)
    return state


def unload(
    method: Method,
    record: Record,
    state: ContactState,
    axis: Axis,
    index: int,
    progress: Progress | None,
    marks: Sequence[float] = (),
) -> None:
    """Go back by load steps, the next one below ``index``, until contact is lost.

    Parameters
    ----------
    method : Method
    record : Record
        Of the loading branch; it gets the unloading branch too.
    state : ContactState
        At the turning point.
    axis : Axis
    index : int
        Number of the first load step at or above the turning point.
    progress : callable, optional
        See :data:`Progress`.
    marks : sequence of float
        Further places below the turning point, none of them a load step, at which a step ends.

    Raises
    ------
    PathError
        If the path cannot be followed or does not end.
    """
    # The turning point belongs to both branches: it starts the unloading curve.
    record.visit("unloading", True, state)
    i = index
    stride = 1
    ahead = sorted(marks)
    while state.patches:
        i -= stride
        end = axis(i)
        if _too_far(method.problem, end, (index - i) / axis.load_steps):
            raise PathError(f"still in contact at {end:g}")
        if index - i >= _STROKES_AT_STEP * axis.load_steps:
            stride = _stride(method.problem, axis, i, stride)
        stops = []
        while ahead and ahead[-1] > end:
            stops.append(ahead.pop())
        for drive in [*stops, end]:
            state = record.extend(
                "unloading", method.follow(state, method.problem.prescribed(drive))
            )
            if progress is not None:
                progress("unloading", drive, state)
            if not state.patches:
                break


def _too_far(problem: Problem, drive: float, strokes: float) -> bool:
    """Whether a loop that is still in contact at ``drive`` is a bug."""
    if problem.control.is_load:
        return strokes > _FARTHEST
    return drive < -_FARTHEST_HEIGHTS


def _stride(problem: Problem, axis: Axis, index: int, last: int) -> int:
    """Load steps to the next state, far below the turning point: at most twice as many as last.

    Under a load there is no height that steps could be measured by.
    """
    if problem.control.is_load:
        return 1
    step = axis(index + 1) - axis(index)
    wanted = _LONG_STEP * max(1.0, -axis(index)) / step
    return max(1, min(2 * last, int(wanted)))
