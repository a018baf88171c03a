"""Interface of a system of edges, behind which few and many gaps are solved differently."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.gradient_flow import Descent
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.equilibrium.linear_exterior import Linearisation
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.system.edge_problem import EdgeProblem

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Result of Newton's iteration for C_e = C_c.

    Attributes
    ----------
    found : bool
        Whether the iteration converged to a stable equilibrium within reach.
    gaps : array, shape (L, 2)
    solution : Solution
    rate : array, shape (2L,)
        dn/dd of every edge along the branch.
    slope : float
        dY/dd along the branch.
    lost_edge : int
        Where nothing was found, the edge that moved away; -1 if it is unknown.
    linearisation : Linearisation or None
        Of many gaps: with which windows are set up.
    """

    found: bool
    gaps: Array
    solution: Solution
    rate: Array
    slope: float
    lost_edge: int = -1
    linearisation: Linearisation | None = None


class EdgeSystem(ABC):
    """Field, equilibrium and descent of the edges of given gaps.

    Parameters
    ----------
    problem : EdgeProblem

    Attributes
    ----------
    uses_windows : bool
        Whether few gaps are followed in windows, the others responding linearly.
    closing_factor : float
        A gap closes locally at most so many times faster than gaps on average. Where a search for
        touches costs more than to return to a touch that was passed, this is 1.
    """

    uses_windows: ClassVar[bool]
    closing_factor: ClassVar[float]

    def __init__(self, problem: EdgeProblem) -> None:
        self._problem = problem

    @abstractmethod
    def solution(self, gaps: Array, prescribed: float, share: float) -> Solution:
        """Solve the field of these gaps to a ``share`` of the tolerance."""

    @abstractmethod
    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂C_e/∂θ_f between some edges, the others held, shape (edges, edges)."""

    @abstractmethod
    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, orders: Integers, *, patient: bool
    ) -> Equilibrium:
        """Iterate for the equilibrium near these gaps.

        Raises
        ------
        LinAlgError
            If a tangent is singular.
        """

    @abstractmethod
    def descend(
        self,
        gaps: Array,
        prescribed: float,
        most: int,
        orders: Integers,
        law: EdgeLaw,
        track: Track,
        *,
        equal_speeds: bool,
        compare: bool,
    ) -> Descent:
        """Descend in energy for at most ``most`` steps, by a ``law`` of this problem.

        The track is extended or, to ``compare``, compared with.
        """

    @abstractmethod
    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of edges, in θ, that can have closed a gap elsewhere."""
