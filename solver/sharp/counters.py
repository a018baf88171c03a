"""Counters of the work of method ``sharp``."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Counters:
    """Numbers of field solutions, energies, fine openings and steps."""

    fields: int = 0
    energies: int = 0
    openings: int = 0
    newton_steps: int = 0
    descent_steps: int = 0

    def add_newton(self, steps: int) -> None:
        """Add the steps of a Newton iteration."""
        self.newton_steps += steps
        self.fields += steps

    def add_descent(self, steps: int) -> None:
        """Add the steps of a descent."""
        self.descent_steps += steps
        self.fields += steps
