"""Check the turning points of a cycle, and choose the arguments that name them."""

from __future__ import annotations

from typing import Any, TypeVar

from adhesis.solver.checks import (
    FAR_DISPLACEMENT,
    FULL_PENETRATION,
    LOAD_STEPS,
    MAX_PENETRATION,
    MAX_STRESS,
    plain,
    real,
    whole,
)
from adhesis.solver.model.control import Control
from adhesis.solver.model.problem import Problem

T = TypeVar("T")

DEFAULT_LOAD_STEPS = 40
"""Load steps of a loop, unless they are given."""


def check_cycle(
    turning_point: float, load_steps: int, control: Control, name: str = ""
) -> tuple[float, int]:
    """Check a cycle; return turning point (``name`` in errors) and load steps as float and int.

    Raises
    ------
    ValueError
        Unless the turning point is positive and finite and, at fixed separation, below 1, and
        load_steps is a whole number from 1 to 100,000.
    TypeError
        If one of them is not a number.
    """
    own, bounds = "max_penetration", FAR_DISPLACEMENT
    if control.is_fixed:
        bounds = MAX_PENETRATION
    elif control.is_load:
        own, bounds = "max_stress", MAX_STRESS
    return real(name or own, turning_point, bounds), whole("load_steps", load_steps, LOAD_STEPS)


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
    """Return the arguments of ``run_loop``, or ``run_loops``, for turning points of any kind.

    At a preload in Pa the path turns at ``latest`` at the latest.
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
    """Return the turning point of a path whose mean stress does not reach the preload in Pa.

    It is the penetration that is given; without it nearly full contact at fixed separation, and
    with a stiffness the displacement at which every state with a gap carries more.

    Raises
    ------
    ValueError
        If the preload is out of bounds, the path is one under a load, or a stress is given, too.
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
