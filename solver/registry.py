"""Make methods by name."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Literal, get_args

from adhesis.solver.checks import ACCURACY, NODES, NODES_PER_WAVE, choice, instance, real, whole
from adhesis.solver.method import Method
from adhesis.solver.model.problem import Problem
from adhesis.solver.runtime.uninterrupted import uninterrupted

MethodName = Literal["grid", "sharp", "auto"]
METHOD_NAMES: tuple[MethodName, ...] = get_args(MethodName)


def make_method(
    name: MethodName,
    problem: Problem,
    *,
    accuracy: float = 1e-3,
    nodes_per_wave: int | None = None,
) -> Method:
    """Build the method ``name`` for a problem.

    Parameters
    ----------
    name : {"grid", "sharp", "auto"}
    problem : Problem
    accuracy : float
        Wanted relative error of the loss, 1e-10 ≤ accuracy < 1.
    nodes_per_wave : int, optional
        For ``grid``: nodes per shortest wave; by default derived from ``accuracy``.

    Raises
    ------
    ValueError
        For an unknown name or a value outside its range.
    TypeError
        If the problem is not a Problem, or a value not a number.

    References
    ----------
    docs/methods.md, "Which one"

    Examples
    --------
    >>> from adhesis import HalfSpace, Problem, make_method, single_wave
    >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
    >>> make_method("auto", problem).name
    'sharp'
    """
    choice("method", name, METHOD_NAMES)
    instance("problem", problem, Problem, "Problem(profile, half_space, work_of_adhesion)")
    accuracy = real("accuracy", accuracy, ACCURACY)
    has_range = math.isfinite(problem.strength)
    check_law(name, nodes_per_wave, pins=problem.pinning > 0, has_range=has_range)
    if nodes_per_wave is not None:
        nodes_per_wave = whole("nodes_per_wave", nodes_per_wave, NODES_PER_WAVE)
        check_nodes(nodes_per_wave, problem.highest_harmonic)
        if name == "sharp":
            raise ValueError(
                f"nodes_per_wave is {nodes_per_wave}: it belongs to the method 'grid' alone"
            )
    chosen = None
    if name == "auto":
        name, chosen = choose(problem, nodes_per_wave)
    # an interrupted import leaves incomplete modules behind
    uninterrupted(import_module)(f"adhesis.solver.{name}.method")
    if name == "grid":
        from adhesis.solver.grid.method import GridMethod

        return GridMethod(problem, nodes_per_wave=nodes_per_wave, accuracy=accuracy, chosen=chosen)
    from adhesis.solver.sharp.method import SharpMethod

    return SharpMethod(problem, accuracy=accuracy, chosen=chosen)


def check_law(name: MethodName, nodes_per_wave: int | None, *, pins: bool, has_range: bool) -> None:
    """Refuse the method ``grid`` for two works of adhesion, and for a range of adhesion.

    Raises
    ------
    ValueError
        If it is named, or meant by a number of nodes.
    """
    if (name != "grid" and nodes_per_wave is None) or not (pins or has_range):
        return
    given = "method is 'grid'" if name == "grid" else f"nodes_per_wave is {nodes_per_wave}"
    beside = "a work_of_adhesion_open above the work of adhesion"
    reason = "has edges that recede at another one"
    if has_range:
        beside, reason = "a range or strength of adhesion", "has adhesion that acts over a range"
    raise ValueError(f"{given} beside {beside}: leave it out, as only the method 'sharp' {reason}")


def check_nodes(nodes_per_wave: int, waves: int) -> None:
    """Refuse a grid that does not fit into memory.

    Raises
    ------
    ValueError
        If the nodes of all waves are more than :data:`adhesis.solver.checks.NODES` allows.
    """
    if nodes_per_wave * waves > NODES.high:
        raise ValueError(
            f"nodes_per_wave is {nodes_per_wave}: with {waves} waves it must be at most "
            f"{int(NODES.high) // waves}, {NODES.high} nodes in all"
        )


def choose(
    problem: Problem, nodes_per_wave: int | None = None
) -> tuple[Literal["grid", "sharp"], str]:
    """Choose the method for a problem; returns its name and the reason in one sentence.

    The error of ``sharp`` is that of its tolerances, on any spectrum, and with adhesion it is much
    the faster one (docs/methods.md). Without adhesion there are many more patches, and the loss is
    zero at any resolution.
    """
    if nodes_per_wave is not None:
        return "grid", "auto: grid, as a number of nodes per wave is given"
    if problem.work_of_adhesion == 0:
        return "grid", "auto: grid, as there is no adhesion and so no loss to resolve"
    return "sharp", "auto: sharp, whose error of the loss is that of its tolerances, not of a grid"
