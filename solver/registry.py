"""Make methods by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from typing import Literal, get_args

from adhesis.solver.checks import ACCURACY, NODES, NODES_PER_WAVE, choice, instance, real, whole
from adhesis.solver.method import Method
from adhesis.solver.model.problem import Problem
from adhesis.solver.runtime.uninterrupted import uninterrupted

MethodName = Literal["grid", "sharp", "zones", "auto"]
METHOD_NAMES: tuple[MethodName, ...] = get_args(MethodName)

# With a range ``auto`` takes ``zones`` where ``sharp`` may be wrong: zones are longer than this
# share of the shortest wave, or the strength is below this share of E*h', h' the rms slope, which
# bounds the tension by which roughness opens patches. Not with more nodes than these.
_LONG_ZONE, _OPENS = 1 / 32, 0.7
_NODES_OF_ZONES = 1 << 16


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
    name : {"grid", "sharp", "zones", "auto"}
    problem : Problem
    accuracy : float
        Wanted relative error of the loss, 1e-10 ≤ accuracy < 1.
    nodes_per_wave : int, optional
        For ``grid`` and ``zones``: least number of nodes per shortest wave; by default derived
        from ``accuracy``, and for ``zones`` from the length of zones.

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
    if problem.work_of_adhesion > 0:
        has_range = math.isfinite(problem.strength)
        check_law(name, nodes_per_wave, pins=problem.pinning > 0, has_range=has_range)
    if nodes_per_wave is not None:
        nodes_per_wave = whole("nodes_per_wave", nodes_per_wave, NODES_PER_WAVE)
        check_nodes(nodes_per_wave, problem.highest_harmonic)
        if name == "sharp":
            raise ValueError(
                f"nodes_per_wave is {nodes_per_wave}: it belongs to the methods 'grid' and 'zones'"
            )
    chosen = None
    if name == "auto" or (name == "zones" and problem.work_of_adhesion == 0):
        asked = name
        name, reason = choose(problem, nodes_per_wave)
        chosen = f"{asked}: {name}, {reason}"
    # an interrupted import leaves incomplete modules behind
    module = uninterrupted(import_module)(f"adhesis.solver.{name}.method")
    nodes = {} if name == "sharp" else {"nodes_per_wave": nodes_per_wave}
    kind: Callable[..., Method] = getattr(module, f"{name.capitalize()}Method")
    return kind(problem, accuracy=accuracy, chosen=chosen, **nodes)


def check_law(name: MethodName, nodes_per_wave: int | None, *, pins: bool, has_range: bool) -> None:
    """Refuse a method whose edges do not have the law of adhesion that is given.

    Raises
    ------
    ValueError
        For ``grid`` beside a range or two works of adhesion, for ``zones`` without a range; the
        former also where it is meant by a number of nodes.
    """
    if name == "zones" and not has_range:
        raise ValueError(
            "method is 'zones' without a range or strength of adhesion: give one of them, or leave "
            "the method out"
        )
    given = "method is 'grid'" if name == "grid" else f"nodes_per_wave is {nodes_per_wave}"
    if name == "grid" and has_range:
        raise ValueError(
            f"{given} beside a range or strength of adhesion: leave it out, or take the method "
            "'zones'"
        )
    if pins and (name == "grid" or nodes_per_wave is not None):
        raise ValueError(
            f"{given} beside a work_of_adhesion_open above the work of adhesion: leave it out, as "
            "only the method 'sharp' has edges that recede at another one"
        )


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
) -> tuple[Literal["grid", "sharp", "zones"], str]:
    """Choose the method for a problem; returns its name and the reason.

    The error of ``sharp`` is that of its tolerances, on any spectrum, and with adhesion it is much
    the faster one (docs/methods.md). Without adhesion there are many more patches, and the loss is
    zero at any resolution.
    """
    if problem.work_of_adhesion == 0:
        return "grid", "as there is no adhesion and so no loss to resolve"
    if math.isfinite(problem.strength):
        from adhesis.solver.zones.resolution import node_count, zone_length

        nodes = node_count(problem, nodes_per_wave)
        if nodes_per_wave is not None:
            return "zones", "as a number of nodes per wave is given"
        opening = problem.half_space.modulus * math.sqrt(problem.profile.m2)
        opens = problem.strength < _OPENS * opening
        if not opens and zone_length(problem) < _LONG_ZONE * problem.shortest_wavelength:
            return "sharp", "as zones of this range are short, and roughness opens no patch"
        if nodes > _NODES_OF_ZONES:
            return "sharp", f"as zones of this range would need {nodes:,} nodes"
        return "zones", "as zones of this range are not short, or roughness may open patches"
    if nodes_per_wave is not None:
        return "grid", "as a number of nodes per wave is given"
    return "sharp", "whose error of the loss is that of its tolerances, not of a grid"
