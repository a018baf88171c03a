"""Interface of a method, and what it returns.

A method finds equilibrium contact states of one :class:`~adhesis.solver.model.problem.Problem`. The
loading path, the energy audit and the catalogue of jumps (:mod:`adhesis.solver.loading.loop`,
:mod:`adhesis.solver.model.jump`) are written against this contract alone.

To add a method, subclass :class:`Method` and keep these promises:

1.  ``detached(s)`` is the state without contact at separation s ≥ h_max.
2.  ``follow(state, x)`` takes one of the method's equilibrium states to the prescribed value x (a
    separation s; s - p̄/k with a stiffness k, -p̄ under a load) along the quasi-static path and
    returns every visited state in order, the last one at x.
    The direction is free: x below the state's own loads, above it unloads, and at the same
    value the state only settles (first touch at s = h_max is such a case).
3.  The path obeys the rules of evolution (docs/methods.md): contact nucleates only where surfaces
    touch, or come as near as adhesion reaches (``Problem.attraction_range``); it grows and recedes
    by energy descent at a fixed prescribed value, never over an energy maximum, never leaping over
    a neighbouring minimum; inside a patch nothing opens unless the tension reaches a finite
    strength (``Problem.strength``); gaps may close, patches merge and vanish.
4.  Where the path jumps, ``follow`` returns the states just before and just after, both at the
    prescribed value of the jump as the method located it, and a
    :class:`~adhesis.solver.model.jump.Jump` whose energy drop is computed from the two energies,
    not from the load curve. Outside jumps the states are dense enough for the rule of
    :mod:`adhesis.solver.loading.ledger`.
5.  Same input, same bits: no clocks, no unseeded random numbers, no threads.
6.  A state is immutable; ``follow`` may be called again from an older state (partial loops).
7.  Every returned state lies on the path, and surfaces do not overlap in it: no gap is narrower
    than -1e-6 h_max, and below s = h_max no state is without contact. A path that cannot be
    followed under these promises raises a :class:`PathError`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from adhesis.solver.checks import at_least, at_most, instance
from adhesis.solver.model.contact_state import ContactState as ContactState
from adhesis.solver.model.jump import BRANCHES as BRANCHES
from adhesis.solver.model.jump import Branch as Branch
from adhesis.solver.model.jump import Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import highest_peaks, parabola_vertex
from adhesis.solver.runtime.threads import new_lock
from adhesis.solver.values import ByValue
from adhesis.solver.views import NotebookDisplay

# Nodes of fields in which tension is searched, where a method has no grid of its own.
_NODES_PER_WAVE, _FEWEST_NODES = 16, 256


class PathError(RuntimeError):
    """Error raised when a path cannot be followed: there is no state to return.

    References
    ----------
    docs/methods.md, "Rules of evolution"
    """


@dataclass(frozen=True, eq=False, repr=False)
class Path(ByValue):
    """States visited by one call of ``follow``, without its first state.

    Attributes
    ----------
    states : tuple of ContactState
        In the order of the visit, the last one at the prescribed value.
    jumps : tuple of Jump
        In the same order.
    error : float
        Estimated error of a loop's loss due to these states and jumps, in J/m² of nominal area:
        that of energies, stresses and located separations, without that of the trapezoidal rule;
        NaN if unknown.

    References
    ----------
    docs/methods.md, "Rules of evolution"
    """

    states: tuple[ContactState, ...]
    jumps: tuple[Jump, ...]
    error: float = float("nan")


@dataclass(frozen=True, eq=False, repr=False)
class Fields(ByValue):
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


@dataclass(frozen=True, eq=False, repr=False)
class Opening(ByValue):
    """Opening of one gap, from edge to edge of contact; see :mod:`adhesis.solver.observables`.

    Attributes
    ----------
    x : array, shape (points,)
        Position in m, ascending; the first and the last are the edges. It may exceed λ.
    gap : array, shape (points,)
        t in m; zero at the edges. The points are dense enough to interpolate t linearly in φ,
        x = middle - half-width · cos φ.

    References
    ----------
    docs/theory.md, "5. Spectra and densities"
    """

    x: Array
    gap: Array


class PatchTension(NamedTuple):
    """A local maximum of tension inside a patch.

    Attributes
    ----------
    state : int
        Number of the state, of those that were given.
    position : float
        x in m.
    tension : float
        In Pa, positive.
    """

    state: int
    position: float
    tension: float


@dataclass(frozen=True)
class MethodReport:
    """Report of a method; each method adds its settings and counters.

    Attributes
    ----------
    name : str
    chosen : str or None
        Reason for the choice of this method, if ``auto`` made it.
    """

    name: str
    chosen: str | None


class Method(NotebookDisplay, ABC):
    """Base of methods that follow contact states of one problem; see the module's contract.

    Parameters
    ----------
    problem : Problem
    chosen : str, optional
        Reason for the choice of this method, if ``auto`` made it.

    Attributes
    ----------
    nodes : int or None
        Nodes of the method's grid, if it has one.

    Raises
    ------
    ValueError
        If adhesion is too weak or too strong for this method to resolve (``resolved_adhesion``).

    Notes
    -----
    Threads can share a method; one calls it at a time. Methods can be copied and pickled: a copy is
    built from the same arguments and follows the same paths to the last bit.

    References
    ----------
    docs/methods.md, "Rules of evolution"
    """

    name: ClassVar[str]
    nodes: int | None = None
    resolved_adhesion: ClassVar[tuple[float, float]] = (0.0, math.inf)
    """Least and largest γ that the method resolves, over the elastic energy of full contact."""
    has_zones: ClassVar[bool] = False
    """Whether adhesion acts over zones of finite length, so that a range leaves nothing out."""

    _built_from: tuple[tuple[Any, ...], dict[str, Any]]

    def __new__(cls, *args: Any, **options: Any) -> Self:
        """Store the arguments, from which a copy is built."""
        method = super().__new__(cls)
        method._built_from = args, options
        return method

    @property
    def recipe(self) -> Callable[[], Method]:
        """Function that builds the method anew, from the same arguments; it can be pickled."""
        args, options = self._built_from
        return partial(type(self), *args, **options)

    def __repr__(self) -> str:
        """Return one line with the name and the problem."""
        return f"<method {self.name!r} for {self.problem!r}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return self.recipe, ()

    def __init__(self, problem: Problem, *, chosen: str | None = None) -> None:
        how = "Problem(profile, half_space, work_of_adhesion)"
        self.problem = instance("problem", problem, Problem, how)
        self._check_adhesion(self.problem)
        self.chosen = chosen
        self.in_use = new_lock()  # of one_at_a_time

    @classmethod
    def _check_adhesion(cls, problem: Problem) -> None:
        """Raise for a work of adhesion that the method does not resolve."""
        gamma, unit = problem.work_of_adhesion, problem.full_contact_energy
        least, largest = (limit * unit for limit in cls.resolved_adhesion)
        if gamma == 0 or least <= gamma <= largest:
            return
        advice = "check the units of work_of_adhesion, young and the heights"
        if gamma < least:
            advice += ", or take 0, which is contact without adhesion"
        raise ValueError(
            f"work_of_adhesion is {gamma:g} J/m²: for this profile and E* = "
            f"{problem.half_space.modulus:g} Pa the method '{cls.name}' takes from "
            f"{at_least(least, 2)} to {at_most(largest, 2)} J/m² ({cls.resolved_adhesion[0]:g} to "
            f"{cls.resolved_adhesion[1]:g} times the elastic energy of full contact); {advice}"
        )

    @abstractmethod
    def follow(self, state: ContactState, prescribed: float) -> Path:
        """Follow the quasi-static path to a prescribed value: s or s - p̄/k in m, or -p̄ in Pa."""

    @abstractmethod
    def fields(self, state: ContactState, n: int) -> Fields:
        """Compute stress, displacement and gap of ``state`` on n equally spaced nodes.

        Raises
        ------
        ValueError
            If the method cannot compute them for this n.
        """

    @abstractmethod
    def openings(self, state: ContactState) -> list[Opening]:
        """Return the opening of every gap of ``state``; none for a state without contact."""

    def largest_tension(self, states: Sequence[ContactState]) -> PatchTension | None:
        """Find the largest local maximum of tension inside patches, away from their edges.

        Taken from the fields at nodes; a method that knows its stress better overrides this.

        Parameters
        ----------
        states : sequence of ContactState
            States of this method, each in contact.

        Returns
        -------
        PatchTension or None
            None if no state has one: tension falls from the edges inwards, or there is none.
        """
        waves = self.problem.profile.highest_harmonic
        n = self.nodes or max(_FEWEST_NODES, 1 << (_NODES_PER_WAVE * waves - 1).bit_length())
        best: PatchTension | None = None
        for number, state in enumerate(states):
            fields = self.fields(state, n)
            found = _maximum_at_nodes(fields)
            if found is not None and (best is None or found[1] > best.tension):
                best = PatchTension(number, found[0] % self.problem.profile.period, found[1])
        return best

    @abstractmethod
    def report(self) -> MethodReport:
        """Return the resolution, the tolerances and the counters so far."""

    def detached(self, separation: float) -> ContactState:
        """Return the state without contact at ``separation`` (m)."""
        return ContactState.detached(separation)


def _maximum_at_nodes(fields: Fields) -> tuple[float, float] | None:
    """Return position and value of the largest local maximum of tension inside patches.

    A parabola through the node and its neighbours, all of them in contact, refines it.
    """
    tension = np.where(fields.gap <= 0, -fields.stress, np.nan)
    found = highest_peaks(tension, 1)
    if not found:
        return None
    i = found[0]
    shift, highest = parabola_vertex(tension[i - 1], tension[i], tension[(i + 1) % len(tension)])
    return float(fields.x[i] + shift * (fields.x[1] - fields.x[0])), highest
