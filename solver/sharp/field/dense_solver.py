"""The elastic field of given contact edges: every gap is a crack in a full contact.

Full contact carries the stress σ_full; the gaps relieve it. With θ = q0 x, S = 2σ/E*, T = q0 t (gap
opening) and |D| the operator with symbol |m|,

    S = S_full + p + |D| T,      S = 0 in the gaps,  T = 0 on the contact,  mean(T) = q0 s,

p = 2p̄/E* the mean stress. In the coordinate η of each gap
(``conformal_map``) T = sqrt(1-η²) f(η) closes at both ends by
construction, the straight-crack part of |D| is diagonal in the Chebyshev polynomials U_n(η), and
what remains is smooth. So a few values of f per gap carry it all, at the M second-kind
Gauss-Chebyshev nodes of each gap:

    (B + G) f = -(S~ + p X),     Xᵀ f = 2π q0 s,                                     (1)

with quadrature weights w, X = w dθ/dη, B the straight crack (the same for every gap of M nodes),
G_ij = -X_i X_j/(4π sin²(Δθ/2)) between gaps and, in the own gap, the same less the straight crack,
-(w_i w_j/π)[α²/sinh²(α Δη) - 1/Δη²] - (X_i X_j/4π)[1/sin²(Δθ/2) - 4/Δθ²];
the matrix is symmetric positive definite, being the elastic energy of the openings. S~ is S_full
projected on the first M modes; its higher modes meet no smooth kernel and act as in a single
straight crack, so their share of the edge opening is known in closed form. The error is spectral in
M and hardly depends on how narrow the patches are.

At an edge T ≈ C sqrt(r), r the distance from the edge in θ, and

    C = sqrt(2 dη/dθ) [f(±1) - (s^± - Σ_{n<M} (±1)^n s_n)],      K = (E*/4) C sqrt(2π/q0) / q0^0,
    G = K²/(2E*) = π E* C² / (16 q0).

(1) is assembled in ``assembly``; its derivatives with respect to the
edges are in ``edge_derivatives``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.assembly import Parts, assemble, assemble_again, first_nodes
from adhesis.solver.sharp.field.cholesky import cholesky, solve_column, solve_factored
from adhesis.solver.sharp.field.edge_derivatives import derivatives, felt_from_outside
from adhesis.solver.sharp.field.exterior import add_outside, moving_load, reach
from adhesis.solver.sharp.field.solution import (
    FIXED,
    Hold,
    PlainSolution,
    Solution,
    balanced,
    edge_openings,
    openings_at,
    plain,
    without_field,
)
from adhesis.solver.sharp.gap.conformal_map import in_order, map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels, StressSource
from adhesis.solver.sharp.gap.quadrature import RULES, Kinds, Rules, choose_kinds


class GapField:
    """Solution of (1) for given gap ends.

    Parameters
    ----------
    source : StressSource
    gaps : array, shape (L, 2)
        Left and right end of each gap in θ: increasing, the last right end below
        gaps[0, 0] + 2π.
    prescribed : float
        d of :class:`Hold`: q0 s at fixed separation.
    tolerance : float
        Wanted relative accuracy of the interaction between gaps.
    hold : Hold
    solution : Solution, optional
        The solution for these gaps, if it is known already.

    Attributes
    ----------
    opening : array, shape (L, 2)
        C at each gap end.
    pressure : float
        p = 2p̄/E*.

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
        hold: Hold = FIXED,
        solution: Solution | None = None,
    ) -> None:
        self.source, self.gaps, self.prescribed, self.hold = source, gaps, prescribed, hold
        if solution is None:
            kinds = choose_kinds(map_gaps(gaps), -np.log(tolerance), RULES.counts)
            solution = Solution(
                *solve_plain(gaps, prescribed, hold, kinds, 2, RULES, source.panels)
            )
        if np.isnan(solution.pressure):
            raise FloatingPointError("the matrix of the gaps is not positive definite")
        self.solution = solution
        self.pressure = float(solution.pressure)
        self.separation = float(solution.separation)
        self.opening = solution.opening.reshape(-1, 2)

    @property
    def pressure_by_prescribed(self) -> float:
        """∂p/∂d at fixed edges; negative."""
        return -2 * np.pi / float(self.solution.resistance)

    @property
    def separation_by_prescribed(self) -> float:
        """∂(q0 s)/∂d at fixed edges."""
        return -float(self.solution.unit_mean) * self.pressure_by_prescribed / (2 * np.pi)

    @cached_property
    def opening_by_prescribed(self) -> Array:
        """∂C/∂d at fixed edges, shape (L, 2)."""
        of = self.solution
        unit = np.ascontiguousarray(-self.pressure_by_prescribed * of.solved[:, 1:2])
        out: Array = edge_openings(unit, of.slope, of.kinds, of.offset, RULES.start, RULES.ends)
        return out[:, 0].reshape(-1, 2)

    @cached_property
    def derivatives(self) -> tuple[Array, Array]:
        """∂C_e/∂θ_f, shape (2L, 2L), and ∂Y/∂θ_f, shape (2L,), at fixed d (Y is p, or q0 s).

        Edges in the order of ``gaps.ravel()``; θ_f grows to the right.
        """
        by_edge, pressure = derivatives(self.solution, RULES)
        return by_edge, pressure


@compiled
def solve(
    gaps: Array,
    prescribed: float,
    hold: Hold,
    kinds: Kinds,
    fields: int,
    rules: Rules,
    panels: Panels,
) -> Solution:
    """Solve (1) with the source S (``fields`` 1), or S and S' (2) for :func:`derivatives`.

    An iteration must keep the kinds: where they change, the field jumps by its error. The pressure
    is NaN if the matrix is not positive definite to rounding, or edges are no numbers or cross.
    """
    table = map_gaps(gaps)
    if not in_order(table):
        return without_field(table, kinds, hold)
    offset = first_nodes(kinds, rules, panels)
    parts = assemble(table, kinds, offset, fields, rules, panels)
    return _solved(table, kinds, offset, parts, prescribed, hold, fields, rules, panels)


@compiled
def solve_again(
    gaps: Array,
    prescribed: float,
    hold: Hold,
    kinds: Kinds,
    rules: Rules,
    panels: Panels,
    before: Solution,
) -> Solution:
    """Solve (1) with S and S' when some gaps are as they were in such a solution ``before``.

    What belongs to those gaps is taken over.
    """
    table = map_gaps(gaps)
    if not in_order(table):
        return without_field(table, kinds, hold)
    offset = first_nodes(kinds, rules, panels)
    if panels.outside.theta.shape[0] > 0 or not np.array_equal(kinds, before.kinds):
        parts = assemble(table, kinds, offset, 2, rules, panels)
    else:
        parts = assemble_again(table, kinds, offset, rules, panels, before)
    return _solved(table, kinds, offset, parts, prescribed, hold, 2, rules, panels)


@compiled
def solve_plain(
    gaps: Array,
    prescribed: float,
    hold: Hold,
    kinds: Kinds,
    fields: int,
    rules: Rules,
    panels: Panels,
) -> PlainSolution:
    """As :func:`solve`, for calls from Python."""
    return plain(solve(gaps, prescribed, hold, kinds, fields, rules, panels))


@compiled
def _solved(
    table: Array,
    kinds: Kinds,
    offset: Kinds,
    parts: Parts,
    prescribed: float,
    hold: Hold,
    fields: int,
    rules: Rules,
    panels: Panels,
) -> Solution:
    """Solution of the assembled equations."""
    theta, weight, slope, matrix, rhs, beyond = parts
    windowed = panels.outside.theta.shape[0] > 0
    rows, slopes = reach(theta, weight, panels.outside)
    drawn = rows
    if windowed:
        drawn = add_outside(rows, panels.outside, matrix, rhs)
    felt_load = np.empty((0, 0))
    felt_area = np.empty(0)
    felt_shift = 0.0
    factor, definite = cholesky(matrix)
    solved = rhs.copy()
    opening = np.full(2 * table.shape[0], np.nan)
    pressure = np.nan
    unit_mean = np.nan
    resistance = np.nan
    separation = np.nan
    f = np.empty(theta.shape[0])
    if definite:
        solve_factored(factor, solved)
        load_mean = 0.0
        unit_mean = 0.0
        for i in range(theta.shape[0]):
            load_mean += rhs[i, 1] * solved[i, 0]
            unit_mean += rhs[i, 1] * solved[i, 1]
        if windowed:
            load_mean -= panels.outside.mean[0]
            unit_mean += panels.outside.mean[1]
        resistance, pressure, separation = balanced(load_mean, unit_mean, prescribed, hold)
        f, opening = openings_at(pressure, solved, slope, beyond, kinds, offset, rules)
        if windowed:
            opening[-2:] = panels.outside.opening
            if fields > 1:
                load, felt_shift = moving_load(rows, slopes, drawn, panels.outside, f, pressure)
                solve_column(factor, load)
                for i in range(theta.shape[0]):
                    solved[i, 2] += load[i]
                felt_load, felt_area = felt_from_outside(
                    table, slope, kinds, offset, rules, rows, drawn, panels.outside
                )
    return Solution(
        table, kinds, offset, theta, weight, slope, matrix, factor, rhs, solved, beyond,
        hold.share, unit_mean, resistance, separation, pressure, f, opening, felt_load, felt_area,
        felt_shift,
    )  # fmt: skip
