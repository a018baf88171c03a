"""Run one complete loading-unloading loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import process_time
from typing import Any, TypeVar

from adhesis.solver import views
from adhesis.solver.checks import (
    FAR_DISPLACEMENT,
    FULL_PENETRATION,
    LOAD_STEPS,
    MAX_PENETRATION,
    MAX_STRESS,
    function,
    instance,
    plain,
    real,
    whole,
)
from adhesis.solver.loading.loop_result import LoopResult, result_of
from adhesis.solver.loading.mean_stress_event import follow_to_stress
from adhesis.solver.loading.path_record import Axis, Record
from adhesis.solver.method import ContactState, Method, Path, PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.problem import Problem

T = TypeVar("T")

DEFAULT_LOAD_STEPS = 40
"""Load steps of a loop, unless they are given."""

HOW_METHOD = "make_method(name, problem)"
"""Call that makes a method, for error messages."""

Progress = Callable[[Branch, float, ContactState], None]
"""Called after each load step with branch, penetration Δ/h_max and state; may raise to stop."""


@contextmanager
def progress_of(
    progress: Progress | bool | None, top: float, control: Control
) -> Iterator[Progress | None]:
    """Return the function to call after each load step: the given one, or for True a bar.

    Parameters
    ----------
    progress : callable or bool, optional
    top : float
        The largest turning point, at which the bar is full.
    control : Control
        Of the path: a load is shown with its unit.

    Raises
    ------
    TypeError
        If it is neither.
    """
    if progress is True:
        with views.maker().progress_bar(top, control.is_load) as bar:
            yield bar
    elif progress is False:
        yield None
    else:
        yield function("progress", progress)


# Beyond this multiple of the loading range, unloading takes longer steps: of the given share of the
# control's natural range (h_max at fixed separation) or of the distance from first touch. Loops of
# ordinary depth detach long before.
_STROKES_AT_STEP = 20
_LONG_STEP = 0.02
# Unloading stops with an error this many natural ranges below first touch. Contact detaches at
# about sqrt(γ/energy of full contact) ranges, and methods accept γ up to 1e12 of those energies.
_FARTHEST = 1e7


def check_cycle(turning_point: float, load_steps: int, control: Control) -> tuple[float, int]:
    """Check a cycle; return its turning point and load steps as float and int.

    Raises
    ------
    ValueError
        Unless the turning point is positive and finite and, at fixed separation, below 1, and
        load_steps is a whole number from 1 to 100,000.
    TypeError
        If one of them is not a number.
    """
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
    preload: float | None = None,
    load_steps: int = DEFAULT_LOAD_STEPS,
    progress: Progress | bool | None = None,
    on_state: Callable[[Branch, ContactState], None] | None = None,
) -> LoopResult:
    """Load from first touch to the turning point, then unload until detached.

    Parameters
    ----------
    method : Method
    max_penetration : float
        Δ~max = Δ/h_max, 0 < Δ~max < 1; u_tot/h_max if the control is a stiffness. With a preload it
        is where the path turns at the latest (by default 0.999; with a stiffness no limit).
    max_stress : float
        Instead, under a load: p̄ in Pa, positive.
    preload : float
        Instead, at a fixed separation or with a stiffness: p̄ in Pa, positive. The path turns in the
        first state whose mean stress is at least that.
    load_steps : int
        Equal steps of the loading branch, with a preload up to the latest turning point; unloading
        uses the same step.
    progress : callable or bool, optional
        True shows a bar, in a terminal or notebook; a function is called as :data:`Progress` says.
    on_state : callable, optional
        Called with every state of the path, in order (for fields at chosen penetrations).

    Raises
    ------
    ValueError
        If the cycle cannot be run (:func:`check_cycle`).
    TypeError
        If the method is not a Method, or a value not a number.
    PathError
        If the path cannot be followed, or the contact does not detach (:func:`unload`).

    References
    ----------
    docs/theory.md, "3. The loop"
    """
    control = instance("method", method, Method, HOW_METHOD).problem.control
    if preload is None:
        turning_point = turning_of(control, max_penetration, max_stress)
    else:
        turning_point = latest_turn(method.problem, preload, max_penetration, max_stress)
    turning_point, load_steps = check_cycle(turning_point, load_steps, control)
    function("on_state", on_state)
    started = process_time()
    record = Record(on_state)
    axis = Axis(turning_point, load_steps)
    state = method.detached(method.problem.profile.h_max)
    with progress_of(progress, turning_point, control) as report:
        record.visit("loading", False, state)
        for i in range(load_steps + 1):
            path, reached = load_step(method, record, axis(i), preload)
            state = record.extend("loading", path)
            turn = drive_in(method.problem, state) if reached else axis(i)
            if report is not None:
                report("loading", turn, state)
            if reached:
                break
        unload_recorded(method, record, state, axis, turn, report)
    return result_of(
        method, record, turn, i if reached else load_steps, started, axis.step, preload
    )


def turning_of(control: Control, max_penetration: T | None, max_stress: T | None) -> T:
    """Select the turning point, or points, of the control.

    Raises
    ------
    ValueError
        If the argument of another control is given, or none.
    """
    wanted, other = ("max_penetration", max_penetration), ("max_stress", max_stress)
    if control.is_load:
        wanted, other = other, wanted
    elif max_stress is not None:
        raise ValueError(
            "max_stress is given, but a path under a separation or a stiffness turns at "
            "max_penetration: a weight or a machine? For a weight give the problem "
            "control=Control(0); for a machine, which turns at that mean stress, give preload "
            "instead of max_stress"
        )
    if wanted[1] is None or other[1] is not None:
        under = "a load" if control.is_load else "a separation or a stiffness"
        raise ValueError(
            f"a path under {under} turns at {wanted[0]}: give that, and no {other[0]}"
            + ("" if control.is_load else " (or give preload, in Pa)")
        )
    return wanted[1]


def turn_arguments(
    control: Control, turn: object, at_preload: bool, latest: float | None
) -> dict[str, Any]:
    """Return the arguments of :func:`run_loop` for a turning point of any kind.

    Parameters
    ----------
    control : Control
    turn : object
        Turning point, or turning points of ``run_loops``.
    at_preload : bool
        Whether it is a preload in Pa.
    latest : float, optional
        Then, where the path turns at the latest.
    """
    if at_preload:
        return {"preload": turn, "max_penetration": latest}
    return {"max_stress" if control.is_load else "max_penetration": turn}


def check_preload(preload: float, control: Control) -> float:
    """Check the mean stress in Pa at which a path turns, and return it as float.

    Raises
    ------
    ValueError
        If it is out of bounds, or the path is one under a load.
    TypeError
        If it is not a number.
    """
    preload = real("preload", preload, MAX_STRESS)
    if control.is_load:
        raise ValueError(
            f"preload is {plain(preload)} Pa under a load: a weight or a machine? A weight turns "
            "at max_stress; at a preload turns a machine, which prescribes the separation or has a "
            "stiffness"
        )
    return preload


def latest_turn(
    problem: Problem, preload: float, max_penetration: float | None, max_stress: object = None
) -> float:
    """Return the turning point of a path whose mean stress does not reach the preload.

    Parameters
    ----------
    problem : Problem
    preload : float
        In Pa; the largest of several.
    max_penetration : float, optional
        As given; without it nearly full contact at fixed separation, and with a stiffness the
        displacement at which every state with a gap carries more.
    max_stress : object
        Refused, unless it is None.

    Raises
    ------
    ValueError
        If the preload is out of bounds, or the path is one under a load.
    TypeError
        If it is not a number.
    """
    preload = check_preload(preload, problem.control)
    if max_stress is not None:
        raise ValueError(
            "preload and max_stress are given: a machine turns at a preload, a weight "
            "(control=Control(0)) at max_stress"
        )
    if max_penetration is not None:
        return max_penetration
    if problem.control.is_fixed:
        return FULL_PENETRATION
    return 1.0 + preload / (problem.control.stiffness * problem.profile.h_max)


def load_step(
    method: Method, record: Record, drive: float, preload: float | None
) -> tuple[Path, bool]:
    """Follow one load step from the last state of a record, or up to the preload, if there is one.

    Returns
    -------
    Path
    bool
        Whether the mean stress has reached the preload.

    Raises
    ------
    PathError
        If the path cannot be followed.
    """
    state, prescribed = record.states[-1], method.problem.prescribed(drive)
    if preload is None:
        return method.follow(state, prescribed), False
    return follow_to_stress(method, state, prescribed, preload)


def drive_in(problem: Problem, state: ContactState) -> float:
    """Compute the value of the control in a state: Δ/h_max, or u_tot/h_max of a stiffness."""
    return problem.penetration(problem.prescribed_in(state))


def recorder(
    method: Method,
    record: Record,
    branch: Branch,
    state: ContactState,
    progress: Progress | None,
) -> Callable[[float], ContactState]:
    """Return a function that follows one branch from ``state``, one load step per call.

    Its argument is the end of the load step (Δ/h_max, u_tot/h_max or Pa); it adds the visited
    states to the record and returns the last one.
    """

    def step(drive: float) -> ContactState:
        nonlocal state
        state = record.extend(branch, method.follow(state, method.problem.prescribed(drive)))
        if progress is not None:
            progress(branch, drive, state)
        return state

    return step


def unload_recorded(
    method: Method,
    record: Record,
    state: ContactState,
    axis: Axis,
    turn: float,
    progress: Progress | None,
    marks: Sequence[float] = (),
) -> None:
    """Add the unloading branch of a loop to the record of its loading branch; see :func:`unload`.

    The turning point belongs to both branches: its state starts the unloading curve.
    """
    record.visit("unloading", True, state)
    step = recorder(method, record, "unloading", state, progress)
    unload(method.problem, axis, turn, state, step, marks)


def unload(
    problem: Problem,
    axis: Axis,
    turn: float,
    state: ContactState,
    step: Callable[[float], ContactState],
    marks: Sequence[float] = (),
) -> None:
    """Unload by load steps until contact is lost, in loops and paths alike.

    Parameters
    ----------
    problem : Problem
    axis : Axis
    turn : float
        Start of unloading, on the axis or between two of its load steps.
    state : ContactState
        The state there.
    step : callable
        Follows the path to a value on the axis and returns the state there.
    marks : sequence of float
        Further values at which a step ends; those above ``turn`` are ignored. A mark replaces a
        load step within rounding of it.

    Raises
    ------
    PathError
        If the path cannot be followed, or contact is not lost at any plausible separation.
    """
    first = i = axis.above(turn)
    stride = 1
    ahead = sorted(mark for mark in marks if mark < turn)
    unit = problem.prescribed_range / (1.0 if problem.control.is_load else problem.profile.h_max)
    while state.patches:
        i -= stride
        end = axis(i)
        if end < -_FARTHEST * unit:
            where = problem.describe_prescribed(problem.prescribed(end))
            raise PathError(
                f"unloading does not end: surfaces are still in contact at {where}, {_FARTHEST:g} "
                "times the natural range of the profile; check the units of work_of_adhesion, "
                "young and the heights, or try the other method"
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
            state = step(drive)
            if not state.patches:
                break
