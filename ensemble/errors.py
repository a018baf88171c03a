"""Errors that are the user's to mend: one clear sentence, exit code 2."""

from __future__ import annotations


class InputError(Exception):
    """A bad value, file or option. The text names the value and the rule in one sentence."""
