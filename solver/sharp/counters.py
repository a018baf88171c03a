"""What the work of method ``sharp`` cost, counted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Counters:
    """What the work cost: field solutions, derivative solutions, fine openings and energies."""

    fields: int = 0
    derivatives: int = 0
    energies: int = 0
    openings: int = 0
    newton_steps: int = 0
    descent_steps: int = 0
