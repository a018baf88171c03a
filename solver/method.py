"""What a method must offer, and the contact states that it hands out.

A method finds equilibrium contact states of one :class:`~solver.problem.Problem`. The loading path,
the energy audit and the catalogue of jumps (:mod:`solver.loop`, :mod:`solver.jumps`) are written
against this contract alone.

To add a method, subclass :class:`Method` and keep these promises:

1.  ``detached(s)`` is the state without contact at separation s ≥ h_max.
2.  ``follow(state, s)`` takes an equilibrium state of its own to separation s along the
    quasi-static path and returns every state it visited on the way, in order, the last one at s.
    The direction is free: s below the state's separation loads, above it unloads, and at the same
    separation the state only settles (first touch at s = h_max is such a case).
3.  The path obeys the rules of evolution (docs/methods.md): contact nucleates only where surfaces
    touch; it grows and recedes by energy descent at fixed separation, never over an energy
    maximum, never leaping over a neighbouring minimum; inside a contact nothing opens; gaps may
    close, patches merge and vanish.
4.  Where the path jumps, ``follow`` returns the states just before and just after, both at the
    separation of the jump as the method located it, and a :class:`~solver.jumps.Jump` whose energy
    drop is computed from the two energies, not from the load curve. Outside jumps the states are
    dense enough for the trapezoidal rule.
5.  Same input, same bits: no clocks, no unseeded random numbers, no threads.
6.  A state is immutable; ``follow`` may be called again from an older state (partial loops).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from solver.jumps import Jump
from solver.problem import Problem
from solver.profile import Array

Branch = Literal["loading", "unloading"]


@dataclass(frozen=True, eq=False)
class ContactState:
    """An equilibrium contact state.

    Attributes
    ----------
    separation : float
        s in m; equals the mean gap.
    edges : array, shape (patches, 2)
        Left and right edge of each patch in m, 0 ≤ left < λ, left < right, sorted by the left
        edge; the right edge of the last patch may exceed λ.
    mean_stress : float
        p̄ in Pa, compression positive.
    elastic_energy, adhesion_energy : float
        ½∫σ(h - s)dx and -γ∫sqrt(1 + h'²)dx over the contact of one period, in J/m.
    contact_fraction : float
        A/A0.
    stiffness : float
        dp̄/ds along the branch in Pa/m where the method knows it, else NaN.
    internal : object
        What the method needs to go on from here; nobody else reads it.

    References
    ----------
    docs/theory.md, "1. The problem"
    """

    separation: float
    edges: Array
    mean_stress: float
    elastic_energy: float
    adhesion_energy: float
    contact_fraction: float
    stiffness: float = float("nan")
    internal: Any = field(default=None, repr=False)

    @property
    def patches(self) -> int:
        """Number of contact patches in one period."""
        return len(self.edges)

    @property
    def energy(self) -> float:
        """U = elastic + adhesion energy of one period, in J/m."""
        return self.elastic_energy + self.adhesion_energy


@dataclass(frozen=True)
class Path:
    """The states from the one that ``follow`` was given (excluded) to the wanted separation.

    Attributes
    ----------
    states : tuple of ContactState
        In the order in which they were visited, the last one at the wanted separation.
    jumps : tuple of Jump
        In the same order.

    References
    ----------
    docs/methods.md, "Rules of evolution"
    """

    states: tuple[ContactState, ...]
    jumps: tuple[Jump, ...]


@dataclass(frozen=True, eq=False)
class Fields:
    """Fields of one state on a grid of n nodes, each of shape (n,).

    Attributes
    ----------
    x : array
        Position in m.
    height : array
        Rigid profile h in m.
    stress : array
        σ in Pa, compression positive; zero outside contact.
    displacement : array
        v in m, zero mean: the deformed surface.
    gap : array
        t = v - h + s in m; zero in contact.

    References
    ----------
    docs/theory.md, "1. The problem"
    """

    x: Array
    height: Array
    stress: Array
    displacement: Array
    gap: Array


class Method(ABC):
    """Finds and follows contact states of one problem; see the module's numbered contract.

    Parameters
    ----------
    problem : Problem

    References
    ----------
    docs/methods.md, "Rules of evolution"
    """

    name: ClassVar[str]
    chosen: str | None = None
    """Why this method was chosen, where the user left the choice open."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    @abstractmethod
    def follow(self, state: ContactState, separation: float) -> Path:
        """Follow the quasi-static path from ``state`` to ``separation`` (m)."""

    @abstractmethod
    def fields(self, state: ContactState, n: int) -> Fields:
        """Stress, displacement and gap of ``state`` on n equally spaced nodes.

        Raises
        ------
        ValueError
            If the method cannot give them at this n.
        """

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return what was chosen and what it cost: resolution, tolerances, counters."""

    def detached(self, separation: float) -> ContactState:
        """State without contact at ``separation`` (m)."""
        return ContactState(separation, np.empty((0, 2)), 0.0, 0.0, 0.0, 0.0)
