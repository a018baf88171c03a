"""Rules for single values: each reads a value, or refuses it with the rule in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ensemble.errors import InputError


@dataclass(frozen=True)
class Rule:
    """What a value must be.

    Attributes
    ----------
    text : str
        The rule in words, after "it must be".
    read : callable
        Returns the value as it will be used; ValueError if it breaks the rule.
    """

    text: str
    read: Callable[[object], Any]

    def __call__(self, where: str, value: object) -> Any:
        """Return the value as it will be used.

        Raises
        ------
        InputError
            "WHERE is VALUE: it must be RULE".
        """
        try:
            return self.read(value)
        except ValueError:
            raise InputError(f"{where} is {shown(value)}: it must be {self.text}") from None


def shown(value: object) -> str:
    """Return a value as TOML would spell it, short enough for a sentence."""
    try:
        text = {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)
    except ValueError:  # an integer of thousands of digits
        text = "a number of thousands of digits"
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= 80 else f"{text[:60]} … {text[-10:]}"


def _number(value: object) -> float:
    # bool is an int to Python, never to a user.
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError
    try:
        number = float(value)
    except OverflowError:
        raise ValueError from None
    if not math.isfinite(number):
        raise ValueError
    return number


def _number_rule(text: str, holds: Callable[[float], bool]) -> Rule:
    def read(value: object) -> float:
        number = _number(value)
        if not holds(number):
            raise ValueError
        return number + 0.0  # -0.0 becomes 0.0

    return Rule(text, read)


def positive_number(unit: str) -> Rule:
    """0 < value, finite."""
    suffix = "" if unit == "1" else f", in {unit}"
    return _number_rule(f"a positive, finite number{suffix}", lambda x: x > 0)


def not_negative_number(unit: str) -> Rule:
    """0 ≤ value, finite."""
    return _number_rule(f"a finite number that is not negative, in {unit}", lambda x: x >= 0)


def negative_number(least: float) -> Rule:
    """Least ≤ value < 0."""
    return _number_rule(f"a negative number of at least {least:g}", lambda x: least <= x < 0)


def number_between(low: float, high: float, *, upper_included: bool = False) -> Rule:
    """Low < value < high."""
    if upper_included:
        return _number_rule(
            f"a number above {low:g} and at most {high:g}", lambda x: low < x <= high
        )
    return _number_rule(
        f"a number between {low:g} and {high:g}, both excluded", lambda x: low < x < high
    )


def number_from(least: float) -> Rule:
    """Least ≤ value, finite."""
    return _number_rule(f"a finite number of at least {least:g}", lambda x: x >= least)


def whole_number(least: int, most: int = 2**63 - 1) -> Rule:
    """Least ≤ value ≤ most, an integer."""

    def read(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise ValueError
        return value

    limit = f" and at most {most}" if most < 2**63 - 1 else ""
    return Rule(f"a whole number of at least {least}{limit}", read)


def choice(*names: str) -> Rule:
    """One of the names."""

    def read(value: object) -> str:
        if not isinstance(value, str) or value not in names:
            raise ValueError
        return value

    return Rule("one of " + ", ".join(f'"{name}"' for name in names), read)


def list_of(rule: Rule, *, may_be_empty: bool = False) -> Rule:
    """Return the rule of a list of different values, each by ``rule``; read as a tuple."""

    def read(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not (value or may_be_empty):
            raise ValueError
        values = tuple(rule.read(v) for v in value)
        if len(set(values)) < len(values):
            raise ValueError
        return values

    return Rule(f"a list of different values, each {rule.text}", read)


def list_of_names() -> Rule:
    """Lists of two or more names each; read as a tuple of sorted tuples."""

    def read(value: object) -> tuple[tuple[str, ...], ...]:
        if not isinstance(value, list):
            raise ValueError
        groups = []
        for names in value:
            if not isinstance(names, list) or len(names) < 2:
                raise ValueError
            if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
                raise ValueError
            groups.append(tuple(sorted(names)))
        if len({name for group in groups for name in group}) < sum(map(len, groups)):
            raise ValueError
        return tuple(sorted(groups))

    return Rule('a list of groups of keys, as [["hurst", "m2"]], no key twice', read)
