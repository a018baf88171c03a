"""Read loading paths from options: turning points or any path, and the control."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.number_lists import words_of
from adhesis.ensemble.stresses import parse_stress
from adhesis.solver.loading.loop import check_cycle
from adhesis.solver.loading.path import check_path
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem

_OUT = "out"
_MAX_PENETRATION = 0.9


@dataclass(frozen=True)
class Cycle:
    """Loading path and control of a loop.

    Attributes
    ----------
    control : Control
    turning_points : tuple of float
        One for each loop; those of one path, in order, if ``is_path``. Δ/h_max, u_tot/h_max, or
        Pa under a load.
    is_path : bool
    out : bool
        Whether a path continues until contact is lost.
    load_steps : int
    """

    control: Control
    turning_points: tuple[float, ...]
    is_path: bool
    out: bool
    load_steps: int

    @property
    def top(self) -> float:
        """Largest turning point."""
        return max(self.turning_points)

    def check(self, problem: Problem) -> None:
        """Check that the cycle can be followed.

        Raises
        ------
        ValueError
            If it breaks a rule, which the message gives.
        """
        if self.is_path:
            check_path(self.turning_points, self.load_steps, problem, self.out)
        for turn in () if self.is_path else self.turning_points:
            check_cycle(turn, self.load_steps, self.control)


def cycle_of(args: argparse.Namespace, half_space: HalfSpace) -> Cycle:
    """Read the cycle from the options.

    Raises
    ------
    InputError
        If the options contradict one another or are no numbers.
    ValueError
        If stiffness or layer break their rule.
    """
    control = control_of(args, half_space)
    _refuse_several(args, "max_penetration", "max_stress", "path")
    if args.path is not None:
        words = _words("--path", args.path)
        out = words[-1] == _OUT
        rule = "numbers with commas between them"
        points = _numbers("--path", words[:-1] if out else words, rule)
        return Cycle(control, points, True, out, args.load_steps)
    points = turning_points_of(args, control)
    return Cycle(control, tuple(sorted(points)), False, True, args.load_steps)


def turning_points_of(args: argparse.Namespace, control: Control) -> tuple[float, ...]:
    """Read the turning points of a control, in the given order.

    Raises
    ------
    InputError
        If they belong to another control, are no numbers, or one is given twice.
    """
    _refuse_several(args, "max_penetration", "max_stress")
    if control.is_load != (args.max_stress is not None):
        if control.is_load:
            raise InputError("load control (--stiffness 0) needs --max-stress, in Pa")
        raise InputError("--max-stress belongs to load control: give --stiffness 0 with it")
    text = args.max_stress if control.is_load else args.max_penetration
    name = "--max-stress" if control.is_load else "--max-penetration"
    if text is None:
        points: tuple[float, ...] = (_MAX_PENETRATION,)
    else:
        words = _words(name, text)
        rule = "one or more numbers, as 1.5 or 0.5,1.5"
        if control.is_fixed:
            rule = "one or more numbers between 0 and 1, as 0.9 or 0.3,0.6"
        points = _stresses(name, words) if control.is_load else _numbers(name, words, rule)
    if len(set(points)) < len(points):
        raise InputError(f"{name} is {text}: turning points must differ")
    return points


def control_of(args: argparse.Namespace, half_space: HalfSpace) -> Control:
    """Read the control: a fixed separation, a stiffness, that of a layer, or a load.

    Raises
    ------
    InputError
        If both a stiffness and a layer are given.
    ValueError
        If one of them breaks its rule.
    """
    if args.layer is not None:
        if args.stiffness is not None:
            raise InputError("--stiffness and --layer are given: give one of them")
        return Control(half_space.layer_stiffness(args.layer))
    return Control(math.inf if args.stiffness is None else args.stiffness)


def in_options(text: str, args: argparse.Namespace) -> str:
    """Return a message on a path with the options that prescribe a stiffness or the separation."""
    option = "--stiffness" if args.layer is None else "--layer"
    for words, replacement in (
        ("give a stiffness", "give --stiffness K"),
        (
            "give a larger stiffness",
            "give a thinner --layer" if args.layer is not None else "give a larger --stiffness",
        ),
        ("prescribe the separation", f"prescribe the separation by leaving {option} out"),
    ):
        text = text.replace(words, replacement)
    return text


def _refuse_several(args: argparse.Namespace, *names: str) -> None:
    given = [f"--{n.replace('_', '-')}" for n in names if getattr(args, n) is not None]
    if len(given) > 1:
        raise InputError(f"{' and '.join(given)} are given: a loop has one of them")


def _words(option: str, text: str) -> list[str]:
    try:
        return words_of(text)
    except InputError as error:
        raise InputError(f"{option} {error}") from None


def _numbers(option: str, words: list[str], rule: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        raise InputError(f"{option} is {','.join(words)!r}: it must be {rule}") from None
    if not values:
        raise InputError(f"{option} holds no turning point")
    return values


def _stresses(option: str, words: list[str]) -> tuple[float, ...]:
    try:
        return tuple(parse_stress(word) for word in words)
    except InputError as error:
        raise InputError(f"{option} {error}") from None
