"""Errors that are the user's to mend: one clear sentence, exit code 2."""

from __future__ import annotations

from ensemble.foreign import printable


class _Printable(Exception):
    """An error whose text may hold texts from files, without their control characters."""

    def __str__(self) -> str:
        return printable(super().__str__())


class InputError(_Printable):
    """A bad value, file or option. The text names the value and the rule in one sentence."""


class RankError(InputError):
    """A bad input that one rank alone may have, such as a library that is missing on its node."""


class WriteError(_Printable):
    """A row could not be written: the disk is full, say. What was written before is sound."""
