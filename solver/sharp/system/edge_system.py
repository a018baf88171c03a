"""Interface of a system of edges, behind which few and many gaps are solved differently."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.gradient_flow import Descent
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.field.dense_solver import FixedEdgeResponse
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.system.window_descent import KnownState

Integers = NDArray[np.int64]


class EdgeSystem(ABC):
    """Field, equilibrium and descent of the edges of given gaps.

    Parameters
    ----------
    problem : EdgeProblem

    Attributes
    ----------
    uses_windows : bool
        Whether descents move few gaps at a time, in windows, the others responding linearly.
    closing_factor : float
        A gap closes locally at most so many times faster than gaps on average. Where a search for
        touches costs more than to return to a touch that was passed, this is 1.
    """

    uses_windows: ClassVar[bool]
    closing_factor: ClassVar[float]

    def __init__(self, problem: EdgeProblem) -> None:
        self._problem = problem

    @abstractmethod
    def solution(self, gaps: Array, prescribed: float, share: float, fields: int) -> Solution:
        """Solve these gaps to a ``share`` of the tolerance, with S or (two fields) S and S'."""

    @abstractmethod
    def response_before_fold(self, point: Point) -> FixedEdgeResponse:
        """Return the response at a point next to a fold, the edges that lead to it held."""

    @abstractmethod
    def fold_displacement(self, point: Point) -> float:
        """Estimate how far in d the error of the field displaces the fold next to a point.

        The error of the openings is their difference from those of a more accurate field.
        """

    @abstractmethod
    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂C_e/∂θ_f between some edges, the others held, shape (edges, edges)."""

    @abstractmethod
    def equilibrium(
        self, gaps: Array, prescribed: float, reach: float, orders: Integers, *, strict: bool
    ) -> Point | None:
        """Iterate for the equilibrium near these gaps.

        Returns
        -------
        Point or None
            None unless the iteration converged to a stable equilibrium within reach.

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
        start: KnownState | None = None,
    ) -> Descent:
        """Descend in energy for at most ``most`` steps, by a ``law`` of this problem.

        The track is extended, or with equal speeds compared with. A known state from which the gaps
        differ in one place is the ``start`` of many gaps.
        """

    @abstractmethod
    def closing_motion(self, before: Array, after: Array) -> float:
        """Motion of edges, in θ, that can have closed a gap elsewhere."""
