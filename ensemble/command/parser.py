"""Parse the options of a command; a bad option is one sentence."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from pathlib import Path, PosixPath
from typing import Any, NoReturn

from adhesis.ensemble.errors import InputError, quoted
from adhesis.ensemble.escape import printable

_GIVEN = "_given"  # of a namespace: the options so far


class Parser(argparse.ArgumentParser):
    """Parser of one command: raises InputError instead of printing the usage and exiting."""

    def __init__(
        self,
        program: str,
        description: str,
        examples: Sequence[str],
        options: Sequence[str | tuple[Any, ...]] = (),
    ) -> None:
        """Declare options: name with its metavar ("--out FILE"), type, help, further settings.

        The type of a flag is bool, that of a text None. A title begins a group of options.
        """
        super().__init__(
            prog=program,
            description=description,
            epilog="\n  ".join(["examples:", *examples]),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            exit_on_error=False,
            # what passes options on, as the scripts of jobs/ do, knows them by their names
            allow_abbrev=False,
        )
        for action in (None, "store"):
            self.register("action", action, _StoreOnce)
        whole = within(-math.inf, math.inf, "a whole number", int)
        for kind, convert in ((None, _text), (int, whole), (float, _number), (Path, _path)):
            self.register("type", kind, convert)
        group: argparse._ActionsContainer = self
        for option in options:
            if isinstance(option, str):
                group = self.add_argument_group(option)
                continue
            words, kind, text, *more = option
            name, _, metavar = words.partition(" ")
            of_kind = {"type": kind, "metavar": metavar or None}
            settings = {"action": "store_true"} if kind is bool else of_kind
            group.add_argument(name, help=text, **{**settings, **dict(*more)})

    def parse(self, words: Sequence[str]) -> argparse.Namespace:
        """Return the options; InputError for a bad one, SystemExit after ``--help``."""
        args = argparse.Namespace(**{_GIVEN: set()})
        try:
            self.parse_args(words, args)
            delattr(args, _GIVEN)
            return args
        except argparse.ArgumentError as error:
            if error.argument_name is None:  # of no single option, as newer Pythons have it
                self.error(error.message)
            name, message = error.argument_name, error.message
            if message.startswith("expected "):  # also where it looks like an option, as -1MPa
                message = f"a value is missing; one that begins with - follows a =, as in {name}=-1"
            link = " " if message.startswith("is ") else ": "
            self.error(f"{name}{link}{message}")

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        # "--young=--": some Pythons take the value for the end of the options, and hand on a list
        if action.option_strings and action.nargs is None and arg_strings == ["--"]:
            raise argparse.ArgumentError(action, "is '--': a value is missing")
        return super()._get_values(action, arg_strings)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = ", ".join(map(repr, action.choices))
            raise argparse.ArgumentError(action, f"is {value!r}: it must be one of {names}")

    def error(self, message: str) -> NoReturn:
        """Raise an InputError that names the help."""
        raise InputError(f"{message} ({self.prog} --help lists the options)")


class _StoreOnce(argparse._StoreAction):
    """Store the value of an option, which may be given once."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        given: set[str] = getattr(namespace, _GIVEN, set())
        if option_string is not None and self.dest in given:
            raise argparse.ArgumentError(self, "is given twice: give it once")
        given.add(self.dest)
        super().__call__(parser, namespace, values, option_string)


def _text(value: str) -> str:
    if not value:
        raise argparse.ArgumentTypeError("is '': a value is missing")
    return value


def _refused(value: str, rule: str) -> argparse.ArgumentTypeError:
    return argparse.ArgumentTypeError(f"is {quoted(value)}: it must be {rule}")


def _number(value: str) -> float:
    try:
        return float(value)  # NaN too: the rule of the quantity refuses it
    except ValueError:
        raise _refused(value, "a number, as in 0.5") from None


def within(
    low: float, high: float, rule: str, kind: Callable[[str], float] = float
) -> Callable[[str], Any]:
    """Return the type of an option that is a number between two others."""

    def read(value: str) -> float:
        try:
            number = kind(value)
        except ValueError:
            number = math.nan
        if not low <= number <= high:
            raise _refused(value, rule)
        return number

    return read


def _path(value: str) -> Path:
    if not value or "\0" in value:
        raise _refused(value, "the name of a file or directory")
    return _Named(value)


class _Named(PosixPath):
    """A path that was given; a message that names it spells out its control characters."""

    def __format__(self, form: str) -> str:
        return format(printable(str(self)), form)
