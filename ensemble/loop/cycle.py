"""Read loading paths from options: turning points or any path, and the control."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from adhesis.ensemble.errors import InputError, quoted
from adhesis.ensemble.quantities import STRESS, read_list
from adhesis.ensemble.trace.options import MAX_PENETRATION, refuse_several
from adhesis.solver.loading.cycle import check_cycle, latest_turn, turn_arguments
from adhesis.solver.loading.path import check_path
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem

_TURNS = ("max_penetration", "max_stress", "preload")


@dataclass(frozen=True)
class Cycle:
    """Loading path and control of a loop.

    The turning points are one for each loop; those of one path, in order, if ``is_path``.
    """

    # Δ/h_max, u_tot/h_max, or Pa under a load; preloads in Pa, if ``are_preloads``
    points: tuple[float, ...]
    control: Control
    load_steps: int
    are_preloads: bool = False
    latest: float | None = None  # where a loop turns whose preload is not reached, if it is given
    is_path: bool = False
    out: bool = True  # whether a path continues until contact is lost

    def arguments(self, points: object) -> dict[str, Any]:
        """Return the arguments of ``run_loop`` or ``run_loops`` for some of the points."""
        return turn_arguments(self.control, points, self.are_preloads, self.latest)

    def check(self, problem: Problem) -> None:
        """Check that the cycle can be followed; the ValueError gives the rule that it breaks."""
        if self.is_path:
            check_path(self.points, self.load_steps, problem, self.out)
            return
        for turn in self.points:
            end = latest_turn(problem, turn, self.latest) if self.are_preloads else turn
            check_cycle(end, self.load_steps, self.control)


def cycle_of(args: argparse.Namespace, half_space: HalfSpace) -> Cycle:
    """Read the cycle from the options (InputError; ValueError for stiffness or layer)."""
    control = control_of(args, half_space)
    if args.path is not None:
        refuse_several(args, "path", *_TURNS)
        turns, comma, last = args.path.rpartition(",")
        out = last.strip() == "out"
        if out and not comma:
            raise InputError(f"--path is {quoted(args.path)}: it holds no turning point")
        rule = "numbers with commas between them, and perhaps 'out' behind the last"
        points = read_list("--path", turns if out else args.path, rule=rule, given=args.path)
        return Cycle(points, control, args.load_steps, is_path=True, out=out)
    cycle = turns_of(args, control)
    return replace(cycle, points=tuple(sorted(cycle.points)))


def turns_of(args: argparse.Namespace, control: Control) -> Cycle:
    """Read the cycle of a control, its turning points in the given order (InputError)."""
    refuse_several(args, "max_stress", "preload")
    if control.is_load:
        if args.preload is not None:
            raise InputError(
                f"--preload is {args.preload} with --stiffness 0: a weight or a machine? For a "
                f"weight give --max-stress {args.preload} with --stiffness 0; for a machine, which "
                "turns at that mean stress, leave --stiffness 0 out"
            )
        refuse_several(args, "max_penetration", "max_stress")
        if args.max_stress is None:
            raise InputError("load control (--stiffness 0) needs --max-stress, in Pa")
        stresses = _distinct("--max-stress", args.max_stress, STRESS.read)
        return Cycle(stresses, control, args.load_steps)
    if args.max_stress is not None:
        raise InputError(
            "--max-stress belongs to load control, and --stiffness 0 is not given: a weight or a "
            f"machine? For a weight give --stiffness 0 with --max-stress {args.max_stress}; for a "
            f"machine, which turns at that mean stress, give --preload {args.max_stress} instead"
        )
    rule = "one or more numbers, as 1.5 or 0.5,1.5"
    if control.is_fixed:
        rule = "one or more numbers between 0 and 1, as 0.9 or 0.3,0.6"
    penetrations: tuple[float, ...] = ()
    if args.max_penetration is not None:
        penetrations = _distinct("--max-penetration", args.max_penetration, float, rule)
    if args.preload is None:
        return Cycle(penetrations or (MAX_PENETRATION,), control, args.load_steps)
    if len(penetrations) > 1:
        raise InputError(
            f"--max-penetration is {args.max_penetration} beside --preload: it must be one number, "
            "at which a loop turns that has not reached its preload"
        )
    preloads = _distinct("--preload", args.preload, STRESS.read)
    return Cycle(preloads, control, args.load_steps, True, next(iter(penetrations), None))


def _distinct(
    option: str, text: str, read: Callable[[str], float], rule: str = ""
) -> tuple[float, ...]:
    """Read turning points with commas between them, all different."""
    points = read_list(option, text, read, rule)
    if len(set(points)) < len(points):
        raise InputError(f"{option} is {text}: turning points must differ")
    return points


def control_of(args: argparse.Namespace, half_space: HalfSpace) -> Control:
    """Read the control: a fixed separation, a stiffness, that of a layer, or a load.

    InputError if both a stiffness and a layer are given, ValueError if one breaks its rule.
    """
    refuse_several(args, "stiffness", "layer")
    if args.layer is not None:
        return Control(half_space.layer_stiffness(args.layer))
    return Control(math.inf if args.stiffness is None else args.stiffness)


def in_options(text: str, args: argparse.Namespace) -> str:
    """Return a message on a path with the options that prescribe a stiffness or the separation."""
    option = "--stiffness" if args.layer is None else "--layer"
    weight, change = "--stiffness 0 --max-stress", "larger" if args.layer is None else "thinner"
    for words, replacement in (
        ("give a preload in place of max_stress", f"give --preload in place of {weight}"),
        ("give a larger stiffness", f"give a {change} {option}"),
        ("prescribe the separation", f"prescribe the separation by leaving {option} out"),
    ):
        text = text.replace(words, replacement)
    return text
