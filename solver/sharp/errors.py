"""Ends of a path that are not jumps."""

from __future__ import annotations

from adhesis.solver.method import PathError


class FullContact(Exception):
    """The last gap of the period closes: no state of gaps is left."""


class NoState(PathError):
    """The path has no state at d = ``at``; the text is the reason."""

    def __init__(self, reason: str, at: float) -> None:
        super().__init__(reason)
        self.at = at
