"""Counters of the work of method ``sharp``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Counters:
    """Numbers of field and derivative solutions, energies, fine openings and steps."""

    fields: int = 0
    derivatives: int = 0
    energies: int = 0
    openings: int = 0
    newton_steps: int = 0
    descent_steps: int = 0

    def newton(self, steps: int) -> None:
        """Count the steps of a Newton iteration."""
        self.newton_steps += steps
        self.fields += steps
        self.derivatives += steps

    def descent(self, fields: int, tangents: int) -> None:
        """Count the steps of a descent, of which some had a tangent of their own."""
        self.descent_steps += fields
        self.fields += fields
        self.derivatives += tangents
