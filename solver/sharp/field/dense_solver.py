"""Solve the elastic field of given contact edges: every gap is a crack in a full contact.

Full contact carries the stress σ_full; the gaps relieve it. With θ = q0 x, S = 2σ/E*, T = q0 t (gap
opening) and |D| the operator with symbol |m|,

    S = S_full + p + |D| T,      S = 0 in the gaps,  T = 0 on the contact,  mean(T) = q0 s,

p = 2p̄/E* the mean stress. In the coordinate η of each gap
(``conformal_map``) T = sqrt(1-η²) f(η) closes at both ends by construction, the straight-crack part
of |D| is diagonal in the Chebyshev polynomials U_n(η), and the rest is smooth. So a few values of f
per gap are enough, at its M second-kind Gauss-Chebyshev nodes:

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

K is that of t = (4K/E*) sqrt(r/2π) at the distance r, in m, from an edge. (1) is assembled in
``assembly``; its derivatives with respect to the edges are in ``edge_derivatives``.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.field.assembly import assemble_changed, assemble_dense
from adhesis.solver.sharp.field.cholesky import cholesky, solve_column, solve_factored
from adhesis.solver.sharp.field.edge_derivatives import derivatives
from adhesis.solver.sharp.field.exterior import (
    Exterior,
    ExteriorCoupling,
    add_exterior,
    is_present,
    translation_terms,
)
from adhesis.solver.sharp.field.solution import (
    Equations,
    ExteriorTerms,
    FieldModel,
    LoadingDevice,
    Nodes,
    Solution,
    balance_means,
    combine_openings,
    edge_openings,
    mean_openings,
    no_exterior_terms,
    no_solution,
)
from adhesis.solver.sharp.field.weight_function import exterior_singular_terms
from adhesis.solver.sharp.gap.conformal_map import in_order, map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, Integers


def check_definite(solution: Solution) -> None:
    """Raise FloatingPointError if there is no solution."""
    if math.isnan(solution.pressure):
        raise FloatingPointError("the matrix of the gaps is not positive definite")


class FixedEdgeResponse(NamedTuple):
    """Derivatives by the prescribed quantity d at fixed edges.

    Attributes
    ----------
    pressure : float
        ∂p/∂d; negative.
    separation : float
        ∂(q0 s)/∂d.
    opening : array, shape (2L,)
        ∂C/∂d.
    """

    pressure: float
    separation: float
    opening: Array


def respond_at_fixed_edges(solution: Solution) -> FixedEdgeResponse:
    """Differentiate a solution by d, at fixed edges; FloatingPointError if there is none."""
    check_definite(solution)
    pressure = -2 * np.pi / float(solution.mean.resistance)
    separation = -float(solution.mean.unit_mean) * pressure / (2 * np.pi)
    unit = np.ascontiguousarray(-pressure * solution.solved[:, 1:2])
    opening = edge_openings(unit, solution.nodes, GAUSS_RULES)[:, 0]
    return FixedEdgeResponse(pressure, separation, opening)


class GapField:
    """Solution of (1) for given gap ends.

    Parameters
    ----------
    source : StressSource
    gaps : array, shape (L, 2)
        Left and right end of each gap in θ: increasing, the last right end below
        gaps[0, 0] + 2π.
    prescribed : float
        d of :class:`LoadingDevice`: q0 s at fixed separation.
    tolerance : float
        Wanted relative accuracy of the interaction between gaps.
    device : LoadingDevice
    solution : Solution
        The solution for these gaps.

    Attributes
    ----------
    nearly : tuple of float
        p = 2p̄/E* and q0 s to the accuracy of an equilibrium, known before a field is solved.

    Raises
    ------
    FloatingPointError
        If the matrix of the gaps is not positive definite to rounding.
    """

    def __init__(
        self,
        source: StressSource,
        gaps: Array,
        prescribed: float,
        tolerance: float,
        device: LoadingDevice,
        solution: Solution,
    ) -> None:
        self.source, self.gaps, self.prescribed = source, gaps, prescribed
        self.tolerance, self.device = tolerance, device
        check_definite(solution)
        self._solution = solution
        self.nearly = solution.pressure, solution.separation

    @property
    def solution(self) -> Solution:
        """Solution of equation (1)."""
        return self._solution

    @property
    def pressure(self) -> float:
        """2p̄/E*."""
        return self.solution.pressure

    @property
    def separation(self) -> float:
        """Separation q0 s."""
        return self.solution.separation

    @property
    def opening(self) -> Array:
        """C at each gap end, shape (L, 2)."""
        return self.solution.opening.reshape(-1, 2)

    @cached_property
    def derivatives(self) -> tuple[Array, Array]:
        """∂C_e/∂θ_f, shape (2L, 2L), and ∂Y/∂θ_f, shape (2L,), at fixed d (Y is p, or q0 s).

        Edges in the order of ``gaps.ravel()``; θ_f grows to the right.
        """
        by_edge, conjugate = derivatives(self.solution, GAUSS_RULES)
        return by_edge, conjugate


@compiled_for_both
def solve(
    gaps: Array,
    prescribed: float,
    orders: Integers,
    fields: int,
    model: FieldModel,
    exterior: Exterior,
) -> Solution:
    """Solve (1) with the source S (``fields`` 1), or S and S' (2) for :func:`derivatives`.

    An iteration must keep the orders: where they change, the field jumps by its error. The pressure
    is NaN if the matrix is not positive definite to rounding, or edges are NaN or cross.
    """
    table = map_gaps(gaps)
    if not in_order(table):
        return no_solution(table, orders, model.device)
    nodes, equations = assemble_dense(table, orders, fields, model, exterior)
    return _solve_equations(nodes, equations, prescribed, fields, model, exterior)


@compiled
def solve_again(
    gaps: Array,
    prescribed: float,
    orders: Integers,
    model: FieldModel,
    exterior: Exterior,
    before: Solution,
) -> Solution:
    """Solve (1) with S and S', copying the equations of unchanged gaps.

    They are copied from ``before``, a solution with S and S'.
    """
    table = map_gaps(gaps)
    if not in_order(table):
        return no_solution(table, orders, model.device)
    if is_present(exterior) or not np.array_equal(orders, before.nodes.orders):
        nodes, equations = assemble_dense(table, orders, 2, model, exterior)
    else:
        nodes, equations = assemble_changed(table, before, model)
    return _solve_equations(nodes, equations, prescribed, 2, model, exterior)


@compiled
def _solve_equations(
    nodes: Nodes,
    equations: Equations,
    prescribed: float,
    fields: int,
    model: FieldModel,
    exterior: Exterior,
) -> Solution:
    """Solve the assembled equations, to which the exterior is added."""
    load = equations.load
    empty = np.empty((0, 0))
    coupling = ExteriorCoupling(empty, empty, empty)
    if is_present(exterior):
        coupling = add_exterior(nodes, equations, exterior)
    factor, definite = cholesky(equations.matrix)
    if not definite:
        return no_solution(nodes.table, nodes.orders, model.device)
    solved = load.copy()
    solve_factored(factor, solved)
    load_mean, unit_mean = mean_openings(load, solved)
    if is_present(exterior):
        load_mean -= exterior.mean[0]
        unit_mean += exterior.mean[1]
    mean, pressure, separation = balance_means(load_mean, unit_mean, prescribed, model.device)
    f, opening = combine_openings(pressure, solved, nodes, equations.end_terms, model.rules)
    terms = no_exterior_terms()
    if is_present(exterior):
        opening[-2:] = exterior.opening
        if fields > 1:
            more, shift = translation_terms(coupling, exterior, f, pressure)
            solve_column(factor, more)
            for i in range(more.shape[0]):
                solved[i, 2] += more[i]
            singular, area = exterior_singular_terms(nodes, model.rules, coupling, exterior)
            terms = ExteriorTerms(present=True, load=singular, area=area, shift=shift)
    return Solution(
        nodes=nodes,
        equations=equations,
        factor=factor,
        solved=solved,
        mean=mean,
        separation=separation,
        pressure=pressure,
        scaled_opening=f,
        opening=opening,
        exterior=terms,
    )
