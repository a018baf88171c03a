"""Solve the elastic field of given contact edges: every gap is a crack in a full contact.

Full contact carries the stress σ_full; the gaps relieve it. With θ = q0 x, S = 2σ/E*, T = q0 t (gap
opening) and |D| the operator with symbol |m|,

    S = S_full + p + |D| T,      S = 0 in the gaps,  T = 0 on the contact,  mean(T) = q0 s,

p = 2p̄/E* the mean stress. In the coordinate η of each gap (``kernels/gap.hpp``)
T = sqrt(1-η²) f(η) closes at both ends by construction, the straight-crack part of |D| is diagonal
in the Chebyshev polynomials U_n(η), and the rest is smooth. So a few values of f per gap are
enough, at its M second-kind Gauss-Chebyshev nodes:

    (B + G) f = -(S~ + p X),     Xᵀ f = 2π q0 s,                                     (1)

with quadrature weights w, X = w dθ/dη, B the straight crack (the same for every gap of M nodes),
G_ij = -X_i X_j/(4π sin²(Δθ/2)) between gaps and, in the own gap, the same less the straight crack,
-(w_i w_j/π)[α²/sinh²(α Δη) - 1/Δη²] - (X_i X_j/4π)[1/sin²(Δθ/2) - 4/Δθ²];
the matrix is symmetric positive definite, being the elastic energy of the openings. S~ is S_full
projected on the first M modes; its higher modes meet no smooth kernel and act as in a single
straight crack, so their share of the edge opening is known in closed form. The error is spectral in
M and hardly depends on how narrow the patches are.

At an edge T ≈ C sqrt(r), r the distance from the edge in θ, and

    C = sqrt(2 dη/dθ) [f(±1) - (s^± - Σ_{n<M} (±1)^n s_n)],      K = (E*/4) C sqrt(2π/q0),
    G = K²/(2E*) = π E* C² / (16 q0).

K is that of t = (4K/E*) sqrt(r/2π) at the distance r, in m, from an edge. By Betti's theorem the
elastic energy of one period is

    U = (E*/(2 q0²)) · ½ [∫ S_full h~ dθ + ∫_gaps S_full T dθ - 2π q0 s p],      h~ = q0 h,

the first term being that of full contact. The part of (1) that is
each gap's own is assembled in ``kernels/equations.cpp``; ``kernels/field.cpp`` solves (1) on a tree
of the gaps (``kernels/tree.hpp``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

from adhesis.solver._kernels import SHAPE_NODES, Field
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.gap.full_contact_stress import StressSource


def check_definite(solution: Field) -> None:
    """Raise FloatingPointError if there is no solution."""
    if math.isnan(solution.pressure):
        raise FloatingPointError("the matrix of the gaps is not positive definite")


class GapOpening(NamedTuple):
    """Opening of one gap at its fine sine nodes, θ increasing.

    ``opening`` is T, ``weight`` the Gauss-Chebyshev weight of ∫ T g dθ divided by T, ``modes`` the
    b_n of ``kernels/opening.hpp``.
    """

    theta: Array
    opening: Array
    weight: Array
    modes: Array


class GapField:
    """Field of given gaps, solved when it is asked for.

    Parameters
    ----------
    source : StressSource
    gaps : array, shape (L, 2)
        Left and right end of each gap in θ: increasing, the last right end below
        gaps[0, 0] + 2π.
    prescribed : float
        d of :class:`LoadingDevice`: q0 s at fixed separation.
    solve : callable
        Solves (1) for these gaps.
    nearly : tuple of float, optional
        p = 2p̄/E* and q0 s to the accuracy of an equilibrium, where they are known before the field
        is solved.
    """

    def __init__(
        self,
        source: StressSource,
        gaps: Array,
        prescribed: float,
        solve: Callable[[], Field],
        nearly: tuple[float, float] | None = None,
    ) -> None:
        self.source, self.gaps, self.prescribed = source, gaps, prescribed
        self._solve, self._nearly = solve, nearly
        self._solution: Field | None = None

    @property  # a cached_property of Python 3.11 would hold one lock for the fields of all threads
    def solution(self) -> Field:
        """Solution of equation (1), solved at first access.

        Raises
        ------
        FloatingPointError
            If the matrix of the gaps is not positive definite to rounding.
        """
        if self._solution is None:
            solution = self._solve()
            check_definite(solution)
            self._solution = solution
        return self._solution

    @cached_property
    def work(self) -> float:
        """∫ S_full T dθ over the gaps."""
        return self.solution.work_of_gaps()

    @property
    def nearly(self) -> tuple[float, float]:
        """2p̄/E* and q0 s to the accuracy of an equilibrium."""
        return self._nearly or (self.solution.pressure, self.solution.separation)

    @property
    def edge_opening(self) -> Array:
        """C at each gap end, shape (L, 2)."""
        return self.solution.edge_opening.reshape(-1, 2)

    def fine_opening(self, k: int, per_wave: float = SHAPE_NODES) -> GapOpening:
        """Evaluate the opening T of gap k at fine nodes."""
        return GapOpening(*self.solution.fine_opening(k, per_wave))
