"""The elastic field of given contact edges: every gap is a crack in a full contact.

Full contact carries the stress σ_full; the gaps relieve it. With θ = q0 x, S = 2σ/E*, T = q0 t (gap
opening) and |D| the operator with symbol |m|,

    S = S_full + p + |D| T,      S = 0 in the gaps,  T = 0 on the contact,  mean(T) = q0 s,

p = 2p̄/E* the mean stress. In the coordinate η of each gap (:mod:`solver.sharp.coordinate`)
T = sqrt(1-η²) f(η) closes at both ends by construction, the straight-crack part of |D| is diagonal
in the Chebyshev polynomials U_n(η), and what remains is smooth. So a few values of f per gap carry
it all, at the M second-kind Gauss-Chebyshev nodes of each gap:

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

The derivative of the field with respect to an edge is the homogeneous solution with an opening
∝ 1/sqrt(r) there (Bueckner's and Rice's weight function); the diagonal follows from translation
invariance: moving all edges together is moving the profile, whose source is S_full'.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compiled import compiled, compiled_for_both, compiled_sums
from solver.profile import Array
from solver.sharp.coordinate import (
    ALPHA,
    LEFT,
    LEFT_PATCH,
    RIGHT,
    RIGHT_PATCH,
    convergence,
    map_gaps,
    theta_at,
)
from solver.sharp.linear import cholesky, solve_column, solve_factored, wide
from solver.sharp.moments import gap_moments
from solver.sharp.outside import Outside, add_outside, moving_load, reach
from solver.sharp.source import Panels, StressSource

# Below these arguments the own gap's kernels are taken as series.
_PERIODIC_SERIES = 0.2
_MAPPED_SERIES = 0.3

Kinds = NDArray[np.int64]
"""One whole number a gap: its kind of rule, or its first node."""


class Rules(NamedTuple):
    """Gauss-Chebyshev rules of all mode counts M, end to end, for the compiled code.

    Attributes
    ----------
    counts : int array
        The numbers of nodes M that a gap may have; a gap's "kind" is its place here.
    start, square : int array
        Offset of the vectors and of the M×M matrices of each kind.
    eta, w : array
        Nodes and weights.
    ends : array, shape (2, ·)
        f(-1) and f(+1) from the nodes' values.
    b : array
        The straight crack.
    modes : array
        U_n(η_i), rows nodes.
    """

    counts: NDArray[np.int64]
    start: NDArray[np.int64]
    square: NDArray[np.int64]
    eta: Array
    w: Array
    ends: Array
    b: Array
    modes: Array


def _rules(counts: NDArray[np.int64]) -> Rules:
    eta, weight, ends, b, modes = [], [], [], [], []
    for m in counts:
        t = np.arange(m, 0, -1) * np.pi / (m + 1)  # η increasing
        w = np.pi / (m + 1) * np.sin(t) ** 2
        n = np.arange(m)
        u = np.sin(np.outer(t, n + 1)) / np.sin(t)[:, None]
        to_modes = (2 / np.pi) * u * w[:, None]  # rows nodes, columns modes
        straight = (np.pi / 2) * (to_modes * (n + 1)) @ to_modes.T
        end = to_modes * (n + 1)
        eta.append(np.cos(t))
        weight.append(w)
        ends.append(np.stack([end @ (-1.0) ** n, end.sum(axis=1)]))
        b.append((straight + straight.T).ravel() / 2)
        modes.append(u.ravel())
    return Rules(
        counts,
        np.concatenate([[0], np.cumsum(counts)]),
        np.concatenate([[0], np.cumsum(counts**2)]),
        np.concatenate(eta),
        np.concatenate(weight),
        np.concatenate(ends, axis=1),
        np.concatenate(b),
        np.concatenate(modes),
    )


RULES = _rules(
    np.array([4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 18, 20, 24, 28, 32, 40, 48, 64, 96, 128])
)


class Hold(NamedTuple):
    """What is prescribed, d = share·q0 s - give·p (:mod:`solver.control` in the units used here).

    (1, 0) is a fixed separation, (1, E* q0/(2k)) a stiffness k, (0, 1) a load.
    """

    share: float
    give: float


FIXED = Hold(1.0, 0.0)


class Solution(NamedTuple):
    """Solution of (1), as the compiled code hands it on; N nodes of all gaps together.

    Attributes
    ----------
    table : array
        Of :func:`solver.sharp.coordinate.map_gaps`.
    kinds, offset : int array
        Kind and first node of each gap.
    theta, weight : array, shape (N,)
        θ and X of the nodes.
    slope : array, shape (L, 2)
        dη/dθ at the gap ends.
    matrix, factor : array, shape (N, N)
        B + G and its factor (:func:`solver.sharp.linear.cholesky`).
    rhs, solved : array, shape (N, 2 or 3)
        Loads S~, X and, if asked for, S~', and (B + G)⁻¹ of them.
    beyond : array, shape (L, 2, 1 or 2)
        What the modes of S and S' above M add at the ends.
    share : float
        Of the :class:`Hold`.
    unit_mean, resistance : float
        Xᵀ (B + G)⁻¹ X, and share·that + 2π give: -2π/resistance is ∂p/∂d at fixed edges.
    separation, pressure : float
        q0 s and p = 2p̄/E*.
    f : array, shape (N,)
        The openings over sqrt(1-η²).
    opening : array, shape (2L,)
        C at each gap end.
    felt_load, felt_area, felt_shift : array, array, float
        Of the derivatives, what comes from outside a window (:mod:`solver.sharp.outside`): loads,
        shape (N, 2L), and areas, shape (2L,), of the singular openings, both empty without an
        outside, and the mean opening when all edges move together.
    """

    table: Array
    kinds: NDArray[np.int64]
    offset: NDArray[np.int64]
    theta: Array
    weight: Array
    slope: Array
    matrix: Array
    factor: Array
    rhs: Array
    solved: Array
    beyond: Array
    share: float
    unit_mean: float
    resistance: float
    separation: float
    pressure: float
    f: Array
    opening: Array
    felt_load: Array
    felt_area: Array
    felt_shift: float


PlainSolution = tuple[
    Array, Kinds, Kinds, Array, Array, Array, Array, Array, Array, Array, Array, float, float,
    float, float, float, Array, Array, Array, Array, float,
]  # fmt: skip
"""The fields of :class:`Solution` in order."""


Parts = tuple[Array, Array, Array, Array, Array, Array]
"""θ and X of the nodes, dη/dθ at the ends, matrix, right-hand sides (S~, X, S~') and what the
higher modes add at the ends: the equations (1)."""


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


@compiled_for_both
def choose_kinds(table: Array, digits: float, counts: Kinds) -> Kinds:
    """Kind of each gap whose modes leave an error of exp(-digits), or the largest kind."""
    kinds = np.zeros(table.shape[0], dtype=np.int64)
    for k in range(table.shape[0]):
        wanted = digits / convergence(table[k])
        while kinds[k] < counts.shape[0] - 1 and counts[kinds[k]] < wanted:
            kinds[k] += 1
    return kinds


@compiled
def in_order(table: Array) -> bool:
    """Whether every gap and patch has a length; not so where an edge is no number."""
    for k in range(table.shape[0]):
        # not written as <= : a length that is no number is a failure, too
        length = table[k, RIGHT] - table[k, LEFT]
        if not (length > 0 and table[k, LEFT_PATCH] > 0 and table[k, RIGHT_PATCH] > 0):
            return False
    return True


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
        return _without_field(table, kinds, hold)
    offset = _offsets(kinds, rules, panels)
    parts = _assemble(table, kinds, offset, fields, rules, panels)
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
        return _without_field(table, kinds, hold)
    offset = _offsets(kinds, rules, panels)
    if panels.outside.theta.shape[0] > 0 or not np.array_equal(kinds, before.kinds):
        parts = _assemble(table, kinds, offset, 2, rules, panels)
    else:
        parts = _assemble_again(table, kinds, offset, rules, panels, before)
    return _solved(table, kinds, offset, parts, prescribed, hold, 2, rules, panels)


@compiled
def _offsets(kinds: Kinds, rules: Rules, panels: Panels) -> Kinds:
    """First node of each gap, and the number of all."""
    offset = np.zeros(kinds.shape[0] + 1, dtype=np.int64)
    for k in range(kinds.shape[0]):
        offset[k + 1] = offset[k] + rules.counts[kinds[k]]
    if panels.outside.theta.shape[0] > 0:
        offset[-1] = offset[-2]  # the last gap is the outside
    return offset


@compiled
def _without_field(table: Array, kinds: Kinds, hold: Hold) -> Solution:
    """What is told of edges that are no numbers or cross."""
    nothing, none = np.empty(0), np.empty((0, 0))
    return Solution(
        table, kinds, np.zeros(table.shape[0] + 1, dtype=np.int64), nothing, nothing,
        np.empty((table.shape[0], 2)), none, none, none, none, np.empty((0, 0, 0)), hold.share,
        np.nan, np.nan, np.nan, np.nan, nothing, np.full(2 * table.shape[0], np.nan), none, nothing,
        np.nan,
    )  # fmt: skip


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
        resistance = hold.share * unit_mean + 2 * np.pi * hold.give
        pressure = -(2 * np.pi * prescribed + hold.share * load_mean) / resistance
        separation = prescribed
        if hold.give != 0:
            separation = -(load_mean + pressure * unit_mean) / (2 * np.pi)
        for i in range(theta.shape[0]):
            f[i] = -solved[i, 0] - pressure * solved[i, 1]
        opening = edge_openings(f.reshape(-1, 1), slope, kinds, offset, rules.start, rules.ends)[
            :, 0
        ].copy()
        for k in range(table.shape[0]):
            for side in range(2):
                opening[2 * k + side] -= np.sqrt(2 * slope[k, side]) * beyond[k, side, 0]
        if windowed:
            opening[-2:] = panels.outside.opening
            if fields > 1:
                load, felt_shift = moving_load(rows, slopes, drawn, panels.outside, f, pressure)
                solve_column(factor, load)
                for i in range(theta.shape[0]):
                    solved[i, 2] += load[i]
                felt_load, felt_area = _felt(
                    table, slope, kinds, offset, rules, rows, drawn, panels.outside
                )
    return Solution(
        table, kinds, offset, theta, weight, slope, matrix, factor, rhs, solved, beyond,
        hold.share, unit_mean, resistance, separation, pressure, f, opening, felt_load, felt_area,
        felt_shift,
    )  # fmt: skip


@compiled
def _felt(
    table: Array,
    slope: Array,
    kinds: Kinds,
    offset: Kinds,
    rules: Rules,
    rows: Array,
    drawn: Array,
    outside: Outside,
) -> tuple[Array, Array]:
    """What the outside adds to loads and areas of the singular openings of a window."""
    load = np.zeros((rows.shape[0], 2 * table.shape[0]))
    area = np.zeros(2 * table.shape[0])
    for k in range(table.shape[0] - 1):
        point = np.pi / (rules.counts[kinds[k]] + 1)
        edge_rows, _ = reach(table[k, LEFT : LEFT + 2], point / slope[k], outside)
        for side in range(2):
            e = 2 * k + side
            for a in range(rows.shape[1]):
                area[e] += edge_rows[side, a] * outside.charge[a, 1]
                for i in range(rows.shape[0]):
                    load[i, e] += drawn[i, a] * edge_rows[side, a]
            for j in range(offset[k], offset[k + 1]):
                x = rules.eta[rules.start[kinds[k]] + j - offset[k]]
                density = 1 / (1 + x) if side == 0 else 1 / (1 - x)
                for a in range(rows.shape[1]):
                    area[e] += density * rows[j, a] * outside.charge[a, 1]
    return load, area


@compiled
def plain(of: Solution) -> PlainSolution:
    """Give a solution as a plain tuple, for the way back to Python.

    To make a named one, compiled code calls Python, where a signal's handler may run and raise: an
    exception that is not expected there.
    """
    return (
        of.table, of.kinds, of.offset, of.theta, of.weight, of.slope, of.matrix, of.factor, of.rhs,
        of.solved, of.beyond, of.share, of.unit_mean, of.resistance, of.separation, of.pressure,
        of.f, of.opening, of.felt_load, of.felt_area, of.felt_shift,
    )  # fmt: skip


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


@compiled_for_both
def derivatives(of: Solution, rules: Rules) -> tuple[Array, Array]:
    """∂C_e/∂θ_f, shape (2L, 2L), and ∂Y/∂θ_f, shape (2L,), of a solution with S and S'.

    Y is p, under a load q0 s.
    """
    edges = 2 * of.slope.shape[0]
    load, area = _singular_loads(of, rules)
    windowed = of.felt_area.shape[0] > 0
    if windowed:
        load[:, :edges] += of.felt_load
        area += of.felt_area
    solve_factored(of.factor, load)
    p = area
    for i in range(load.shape[0]):
        for e in range(edges):
            p[e] += of.rhs[i, 1] * load[i, e]
    if of.share == 0:
        p /= 2 * np.pi  # of the separation; the pressure stays
    else:
        p /= of.resistance
        for i in range(load.shape[0]):
            for e in range(edges):
                load[i, e] -= of.solved[i, 1] * p[e]
    openings = edge_openings(load, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    by_edge = openings[:, :edges].copy()
    # Translation: all edges together against the profile.
    drift = 0.0
    for i in range(load.shape[0]):
        drift -= of.rhs[i, 1] * of.solved[i, 2]
    drift += of.felt_shift
    drift = of.share * drift / of.resistance
    moving = np.empty((load.shape[0], 1))
    for i in range(load.shape[0]):
        moving[i, 0] = -of.solved[i, 2] - drift * of.solved[i, 1]
    moved = edge_openings(moving, of.slope, of.kinds, of.offset, rules.start, rules.ends)
    for e in range(edges):
        slope = of.slope[e // 2, e % 2]
        far = of.slope[e // 2, 1 - e % 2]
        by_edge[e ^ 1, e] += 0.5 * np.sqrt(2 * far)  # the singular opening's far end
        strength = (2 * (e % 2) - 1) * of.opening[e] * np.sqrt(slope / 8)
        p[e] *= strength
        for other in range(edges):
            by_edge[other, e] *= strength
    for e in range(edges):
        total = 0.0
        for other in range(edges):
            if other != e:
                total += by_edge[e, other]
        slope = of.slope[e // 2, e % 2]
        by_edge[e, e] = moved[e, 0] - np.sqrt(2 * slope) * of.beyond[e // 2, e % 2, 1] - total
    if windowed:
        # the ends of the outside stay
        typical = 0.0
        for e in range(edges - 2):
            typical = max(typical, abs(by_edge[e, e]))
        by_edge[edges - 2 :] = 0.0
        by_edge[:, edges - 2 :] = 0.0
        by_edge[edges - 2, edges - 2] = typical
        by_edge[edges - 1, edges - 1] = -typical
        p[edges - 2 :] = 0.0
    return by_edge, p


@compiled
def periodic(x: float) -> float:
    """1/sin²(x/2) - 4/x², x = Δθ: what the own gap feels of its periodic images."""
    if abs(x) < _PERIODIC_SERIES:
        y = x * x
        return 1 / 3 + y * (1 / 60 + y * (1 / 1512 + y * (1 / 43200 + y / 1330560)))
    half: float = np.sin(0.5 * x)
    return 1 / (half * half) - 4 / (x * x)


@compiled
def mapped(alpha: float, x: float) -> float:
    """4 [α²/sinh²(αx) - 1/x²], x = Δη: the own gap's kernel beyond a straight crack in η."""
    y = alpha * x
    if abs(y) < _MAPPED_SERIES:
        y *= y
        series = -1 / 3 + y * (1 / 15 + y * (-2 / 189 + y * (1 / 675 - y * 2 / 10395)))
        return 4 * alpha * alpha * series
    images: float = 4 * ((alpha / np.sinh(y)) ** 2 - 1 / (x * x))
    return images


@compiled
def _assemble(
    table: Array, kinds: Kinds, offset: Kinds, fields: int, rules: Rules, panels: Panels
) -> Parts:
    """Matrix and right-hand sides of (1)."""
    gaps = table.shape[0]
    n = offset[gaps]
    theta = np.empty(n)
    weight = np.empty(n)  # dθ/dη times the weight of the rule
    slope = np.empty((gaps, 2))  # dη/dθ at the ends
    rhs = np.empty((n, fields + 1))
    beyond = np.empty((gaps, 2, fields))
    matrix = np.empty((n, n))
    for k in range(gaps):
        if offset[k] == offset[k + 1]:  # the outside of a window
            slope[k] = 1.0
            beyond[k] = 0.0
            continue
        own = slice(offset[k], offset[k + 1])
        one_gap(
            table[k], kinds[k], rules, panels, theta[own], weight[own], slope[k], rhs[own],
            beyond[k], matrix[own, own],
        )  # fmt: skip
    _between_gaps(theta, weight, offset, matrix)
    return theta, weight, slope, matrix, rhs, beyond


@compiled
def _assemble_again(
    table: Array, kinds: Kinds, offset: Kinds, rules: Rules, panels: Panels, before: Solution
) -> Parts:
    """As :func:`_assemble`, with what belongs to gaps that are as they were ``before``.

    A gap's own part depends on its row of the table alone.
    """
    theta, weight, slope = before.theta.copy(), before.weight.copy(), before.slope.copy()
    matrix, rhs, beyond = before.matrix.copy(), before.rhs.copy(), before.beyond.copy()
    changed = np.empty(table.shape[0], dtype=np.int64)
    count = 0
    for k in range(table.shape[0]):
        if np.array_equal(table[k], before.table[k]):
            continue
        changed[count] = k
        count += 1
        own = slice(offset[k], offset[k + 1])
        one_gap(
            table[k], kinds[k], rules, panels, theta[own], weight[own], slope[k], rhs[own],
            beyond[k], matrix[own, own],
        )  # fmt: skip
    _between_gaps_again(theta, weight, offset, changed[:count], matrix)
    return theta, weight, slope, matrix, rhs, beyond


@compiled
def one_gap(
    gap: Array,
    kind: int,
    rules: Rules,
    panels: Panels,
    theta: Array,
    weight: Array,
    slope: Array,
    rhs: Array,
    beyond: Array,
    matrix: Array,
) -> None:
    """Nodes, loads and diagonal block of one gap, and what its higher modes add at the ends."""
    fields = beyond.shape[1]
    m = rules.counts[kind]
    s = np.empty((m, fields))
    ends = np.empty((2, fields))
    gap_moments(gap, panels, s, ends)
    for field in range(fields):
        low = 0.0
        high = 0.0
        sign = 1.0
        for j in range(m):
            high += s[j, field]
            low += sign * s[j, field]
            sign = -sign
        beyond[0, field] = ends[0, field] - low
        beyond[1, field] = ends[1, field] - high
    rule = slice(rules.start[kind], rules.start[kind] + m)
    square = slice(rules.square[kind], rules.square[kind] + m * m)
    _own_gap(
        gap, rules.eta[rule], rules.w[rule], rules.b[square].reshape(m, m),
        rules.modes[square].reshape(m, m), s, theta, weight, slope, rhs, matrix,
    )  # fmt: skip


@compiled
def _own_gap(
    gap: Array,
    eta: Array,
    w: Array,
    b: Array,
    modes: Array,
    s: Array,
    theta: Array,
    weight: Array,
    slope: Array,
    rhs: Array,
    matrix: Array,
) -> None:
    """Nodes, loads and diagonal block of one gap."""
    m = eta.shape[0]
    slope[0] = 1 / theta_at(gap, -1.0)[1]
    slope[1] = 1 / theta_at(gap, 1.0)[1]
    for i in range(m):
        theta[i], stretch = theta_at(gap, eta[i])
        weight[i] = w[i] * stretch
        rhs[i, 1] = weight[i]
        for field in range(s.shape[1]):
            total = 0.0
            for j in range(m):
                total += modes[i, j] * s[j, field]
            rhs[i, 2 * field] = w[i] * total
    # sines of differences from those of the nodes: of small ones the kernels are series
    sine = np.empty(m)
    cosine = np.empty(m)
    power = np.empty(m)
    middle = 0.5 * (gap[LEFT] + gap[RIGHT])
    for i in range(m):
        sine[i] = np.sin(0.5 * (theta[i] - middle))
        cosine[i] = np.cos(0.5 * (theta[i] - middle))
        power[i] = np.exp(gap[ALPHA] * eta[i])
    alpha = gap[ALPHA]
    for i in range(m):
        for j in range(i + 1):
            x = theta[i] - theta[j]
            if abs(x) < _PERIODIC_SERIES:
                far = periodic(x)
            else:
                half = sine[i] * cosine[j] - cosine[i] * sine[j]
                far = 1 / (half * half) - 4 / (x * x)
            y = eta[i] - eta[j]
            if abs(alpha * y) < _MAPPED_SERIES:
                near = mapped(alpha, y)
            else:
                ratio = power[i] / power[j]
                twice = ratio - 1 / ratio  # twice the hyperbolic sine
                near = 4 * (4 * alpha * alpha / (twice * twice) - 1 / (y * y))
            both = weight[i] * weight[j] * far + w[i] * w[j] * near
            matrix[i, j] = b[i, j] - both / (4 * np.pi)
            matrix[j, i] = matrix[i, j]


@compiled_sums
def _row_of_others(
    i: int, first: int, behind: int, sine: Array, cosine: Array, weight: Array, row: Array
) -> None:
    """Into its ``row``: node i of a gap from node ``first`` to ``behind``, and those of others."""
    scale = -weight[i] / (4 * np.pi)
    si = sine[i]
    ci = cosine[i]
    for j in range(first):
        half = si * cosine[j] - ci * sine[j]
        row[j] = scale * weight[j] / (half * half)
    for j in range(behind, row.shape[0]):
        half = si * cosine[j] - ci * sine[j]
        row[j] = scale * weight[j] / (half * half)


@compiled
def _between_gaps(theta: Array, weight: Array, offset: Kinds, matrix: Array) -> None:
    """Blocks of different gaps."""
    sine = np.sin(0.5 * theta)
    cosine = np.cos(0.5 * theta)
    for k in range(offset.shape[0] - 1):
        for i in range(offset[k], offset[k + 1]):
            _row_of_others(i, offset[k], offset[k + 1], sine, cosine, weight, matrix[i])


@compiled
def _between_gaps_again(
    theta: Array, weight: Array, offset: Kinds, changed: Kinds, matrix: Array
) -> None:
    """Blocks between the gaps that have ``changed`` and all others."""
    sine = np.sin(0.5 * theta)
    cosine = np.cos(0.5 * theta)
    for k in changed:
        for i in range(offset[k], offset[k + 1]):
            _row_of_others(i, offset[k], offset[k + 1], sine, cosine, weight, matrix[i])
            for j in range(offset[k]):
                matrix[j, i] = matrix[i, j]
            for j in range(offset[k + 1], matrix.shape[0]):
                matrix[j, i] = matrix[i, j]


@compiled
def edge_openings(
    f: Array, slope: Array, kinds: Kinds, offset: Kinds, start: Kinds, ends: Array
) -> Array:
    """sqrt(2 dη/dθ) f(±1) at every gap end for each column of f, shape (2L, columns)."""
    out = np.zeros((2 * slope.shape[0], f.shape[1]))
    for k in range(slope.shape[0]):
        for side in range(2):
            scale = np.sqrt(2 * slope[k, side])
            for i in range(offset[k + 1] - offset[k]):
                factor = scale * ends[side, start[kinds[k]] + i]
                for j in range(f.shape[1]):
                    out[2 * k + side, j] += factor * f[offset[k] + i, j]
    return out


@compiled_sums
def _singular_load(
    rows: Array,
    density: Array,
    sine: Array,
    cosine: Array,
    weight: Array,
    edge_sine: float,
    edge_cosine: float,
    strength: float,
    out: Array,
) -> None:
    """Into ``out``: load on other gaps of a density of a gap's ``rows`` and a weight at its end."""
    scale = strength / (4 * np.pi)
    for i in range(out.shape[0]):
        half = sine[i] * edge_cosine - cosine[i] * edge_sine
        out[i] = scale * weight[i] / (half * half)
    for j in range(density.shape[0]):
        row = rows[j]
        value = density[j]
        for i in range(out.shape[0]):
            out[i] -= value * row[i]


@compiled
def _singular_loads(of: Solution, rules: Rules) -> tuple[Array, Array]:
    """Right-hand sides of the regular part of the solution singular at each edge, and its area.

    There are more columns than edges, for :mod:`solver.sharp.linear`; those are zero.

    The opening sqrt((1∓η)/(1±η)) of the own gap has the density 1/(1±η) at the nodes and, as the
    rule is exact for polynomials only, a further weight π/(M+1) at the edge itself.
    """
    table, slope, kinds, offset = of.table, of.slope, of.kinds, of.offset
    theta, weight, matrix = of.theta, of.weight, of.matrix
    counts, start, square = rules.counts, rules.start, rules.square
    eta, b, w = rules.eta, rules.b, rules.w
    n = theta.shape[0]
    gaps = table.shape[0]
    load = np.zeros((n, wide(2 * gaps)))
    area = np.empty(2 * gaps)
    sine = np.sin(0.5 * theta)
    cosine = np.cos(0.5 * theta)
    for k in range(gaps):
        if offset[k] == offset[k + 1]:
            load[:, 2 * k : 2 * k + 2] = 0.0
            area[2 * k : 2 * k + 2] = 0.0
            continue
        m = counts[kinds[k]]
        base = offset[k]
        point = np.pi / (m + 1)
        low = np.empty(m)  # 1/(1 + η) and 1/(1 - η)
        high = np.empty(m)
        area[2 * k] = point / slope[k, 0]
        area[2 * k + 1] = point / slope[k, 1]
        for j in range(m):
            x = eta[start[kinds[k]] + j]
            low[j] = 1 / (1 + x)
            high[j] = 1 / (1 - x)
            area[2 * k] += weight[base + j] * low[j]
            area[2 * k + 1] += weight[base + j] * high[j]
        edge_sine = np.sin(0.5 * table[k, LEFT : LEFT + 2])
        edge_cosine = np.cos(0.5 * table[k, LEFT : LEFT + 2])
        crack = b[square[kinds[k]] : square[kinds[k]] + m * m].reshape(m, m)
        for side in range(2):
            edge = table[k, LEFT + side]
            strength = point / slope[k, side]
            density = low if side == 0 else high
            column = np.empty(n)
            _singular_load(
                matrix[base : base + m], density, sine, cosine, weight, edge_sine[side],
                edge_cosine[side], strength, column,
            )  # fmt: skip
            for i in range(m):  # its own gap
                total = 0.0
                for j in range(m):
                    total -= (matrix[base + i, base + j] - crack[i, j]) * density[j]
                place = start[kinds[k]] + i
                bent = w[place] * point * mapped(table[k, ALPHA], eta[place] - (2 * side - 1))
                images = weight[base + i] * strength * periodic(theta[base + i] - edge)
                column[base + i] = total + (bent + images) / (4 * np.pi)
            load[:, 2 * k + side] = column
    return load, area
