"""Errors that end a path: full contact, or no state."""

from __future__ import annotations

from adhesis.solver.method import PathError


class FullContact(Exception):
    """Error raised when the last gap of the period closes: no state with a gap is left."""


class NoState(PathError):
    """Error raised when the path has no state at ``d``; the text is the reason."""

    def __init__(self, reason: str, d: float) -> None:
        super().__init__(reason)
        self.d = d
