"""Equation (1) of ``dense_solver``: nodes, matrix and loads of given gaps.

A gap's own part, its diagonal block and its loads, depends on its row of the table of gaps alone
(:func:`one_gap`); the blocks between gaps are the half-space kernel at their nodes.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_sums
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.gap.chebyshev_moments import gap_moments
from adhesis.solver.sharp.gap.conformal_map import ALPHA, LEFT, RIGHT, theta_at
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules

# Below these arguments the own gap's kernels are taken as series.
_PERIODIC_SERIES = 0.2
_MAPPED_SERIES = 0.3

Parts = tuple[Array, Array, Array, Array, Array, Array]
"""θ and X of the nodes, dη/dθ at the ends, matrix, right-hand sides (S~, X, S~') and what the
higher modes add at the ends: the equations (1)."""


@compiled
def first_nodes(kinds: Kinds, rules: Rules, panels: Panels) -> Kinds:
    """First node of each gap, and the number of all."""
    offset = np.zeros(kinds.shape[0] + 1, dtype=np.int64)
    for k in range(kinds.shape[0]):
        offset[k + 1] = offset[k] + rules.counts[kinds[k]]
    if panels.outside.theta.shape[0] > 0:
        offset[-1] = offset[-2]  # the last gap is the outside
    return offset


@compiled
def assemble(
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
def assemble_again(
    table: Array, kinds: Kinds, offset: Kinds, rules: Rules, panels: Panels, before: Solution
) -> Parts:
    """As :func:`assemble`, with what belongs to gaps that are as they were ``before``.

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
