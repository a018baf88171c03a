"""Rules for single values: each reads a value, or refuses it with the rule in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from adhesis.ensemble.errors import InputError, UnitError
from adhesis.ensemble.quantities import QUANTITIES, Quantity, Written
from adhesis.solver import checks
from adhesis.solver.checks import Bounds


@dataclass(frozen=True)
class Rule:
    """Rule for a value."""

    text: str  # the rule in words, after "it must be"
    # Returns the value as it will be used; TypeError or ValueError if it breaks the rule
    read: Callable[[object], Any]
    bounds: Bounds | None = None  # of the number, or of each one of a list

    def __call__(self, where: str, value: object) -> Any:
        """Return the value as it will be used; InputError "WHERE is VALUE: it must be RULE"."""
        try:
            return self.read(value)
        except UnitError as error:
            raise InputError(f"{where} {error}") from None
        except (TypeError, ValueError):
            raise InputError(f"{where} is {shown(value)}: it must be {self.text}") from None


def shown(value: object) -> str:
    """Return a value as TOML would spell it, short enough for a sentence."""
    return str(value).lower() if isinstance(value, bool) else checks.shown(value)


def number_in(bounds: Bounds, quantity: Quantity | None = None) -> Rule:
    """A number between the solver's bounds; a whole one, where they say so, without a point.

    A quantity, by default that of the bounds' unit, may also be a text with its unit.
    """
    quantity = quantity or QUANTITIES.get(bounds.unit.partition(" ")[0])

    def read(value: object) -> float:
        if quantity is not None and isinstance(value, str):
            value = quantity.read_with_unit(value)
        if bounds.whole and isinstance(value, float):  # to the solver 10.0 is a whole number
            raise ValueError
        number = (checks.whole if bounds.whole else checks.real)("", value, bounds)
        if isinstance(value, Written):
            return Written(number, value.unit)
        if quantity is not None:
            quantity.check(number)
        return number

    example = "" if quantity is None else f', or a {quantity.name} as "{quantity.example}"'
    return Rule(bounds.text + example, read, bounds)


def choice(*names: str) -> Rule:
    """One of the names."""
    text = "one of " + ", ".join(f'"{name}"' for name in names)
    return Rule(text, lambda value: checks.choice("", value, names))


def list_of(rule: Rule, *, may_be_empty: bool = False) -> Rule:
    """Return the rule of a list of different values, each by ``rule``; read as a tuple."""

    def read(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not (value or may_be_empty):
            raise ValueError
        values = tuple(rule.read(v) for v in value)
        if len(set(values)) < len(values):
            raise ValueError
        return values

    return Rule(f"a list of different values, each {rule.text}", read, rule.bounds)


def list_of_names() -> Rule:
    """Lists of two or more names each; read as a tuple of sorted tuples."""

    def read(value: object) -> tuple[tuple[str, ...], ...]:
        groups = lists.read(value)
        names = [name for group in groups for name in group]
        if any(len(group) < 2 for group in groups) or len(set(names)) < len(names):
            raise ValueError
        return tuple(sorted(tuple(sorted(group)) for group in groups))

    name = Rule("a name", lambda value: checks.instance("", value, str, ""))
    lists = list_of(list_of(name), may_be_empty=True)
    return Rule('a list of groups of keys, as [["hurst", "m2"]], no key twice', read)
