"""Errors that are the user's to mend: one clear sentence, exit code 2."""

from __future__ import annotations


class InputError(Exception):
    """A bad value, file or option. The text names the value and the rule in one sentence."""


class RankError(InputError):
    """A bad input that one rank alone may have, such as a library that is missing on its node."""


class WriteError(Exception):
    """A row could not be written: the disk is full, say. What was written before is sound."""
