"""Errors that are the user's to mend: one clear sentence, exit code 2."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from ensemble.foreign import printable


class _Printable(Exception):
    """An error whose text may hold texts from files, without their control characters."""

    def __str__(self) -> str:
        return printable(super().__str__())


class InputError(_Printable, ValueError):
    """A bad value, file or option. The text names the value and the rule in one sentence.

    References
    ----------
    docs/python.md, "Bad input"
    """


class RankError(InputError):
    """A bad input that one rank alone may have, such as a library that is missing on its node."""


class WriteError(_Printable):
    """A row could not be written: the disk is full, say. What was written before is sound."""


_of_a_command: ContextVar[bool] = ContextVar("of_a_command", default=False)


@contextmanager
def naming_options() -> Iterator[None]:
    """Let messages name the options of a command instead of the parameters of functions."""
    before = _of_a_command.set(True)
    try:
        yield
    finally:
        _of_a_command.reset(before)


def parameter(name: str) -> str:
    """Return the name by which a caller gave a parameter: longest_gap, or --longest-gap."""
    return f"--{name.replace('_', '-')}" if _of_a_command.get() else name


@contextmanager
def refused_as_input() -> Iterator[None]:
    """Raise an InputError where a value is refused by the solver; other errors pass."""
    try:
        yield
    except InputError:
        raise
    except ValueError as error:
        raise InputError(str(error)) from None
