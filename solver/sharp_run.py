"""Running edges, compiled: several steps of a descent that share one tangent.

The same arithmetic as :class:`~solver.sharp_gaps.GapField` without derivatives and
:func:`~solver.sharp_path.running_step`, in one compiled loop: a step costs half as much.
"""

from __future__ import annotations

import numpy as np

from solver.compiled import compiled
from solver.profile import Array
from solver.sharp_gaps import MODE_COUNTS, TABLES, assemble, edge_openings
from solver.sharp_map import ALPHA, map_gaps
from solver.sharp_source import StressSource, measure_at
from solver.sharp_step import running_step


def run_held(
    source: StressSource,
    gaps: Array,
    separation: float,
    tolerance: float,
    tangent: tuple[Array, Array],
    last: Array,
    runners: int,
    steps: int,
    limits: tuple[float, float, float],
    critical: float,
) -> tuple[Array, Array, int, int, bool]:
    """Run for up to ``steps`` steps with a held tangent.

    Stops before an edge turns, and after a step in which no edge ran or a patch or gap fell below
    the smallest length.

    Parameters
    ----------
    tangent : (matrix, d)
        Symmetric tangent and its scale factors.
    last, runners
        The step before, and the number of edges that ran in it.
    limits : (longest step, smallest length, overlapping opening)
    critical : float
        Critical opening on a flat piece.

    Returns
    -------
    gaps, last step, runners, fields solved, whether an edge was about to turn
    """
    return _run(  # type: ignore[no-any-return]  # compiled code has no types
        gaps, separation, -np.log(tolerance), *tangent, last, runners, steps, *limits, critical,
        MODE_COUNTS, TABLES.start, TABLES.square, TABLES.eta, TABLES.w, TABLES.ends, TABLES.b,
        TABLES.modes, source.width, source.panels, source.x, source.w, source.coefficients,
        source.weights, source.level_start, source.end_x, source.end_w, source.measure,
    )  # fmt: skip


@compiled
def _run(  # type: ignore[no-untyped-def]  # compiled
    gaps, separation, digits, matrix, d, last, runners, steps, longest, smallest, overlapping,
    critical, counts, start, square, eta, w, ends, b, modes, width, panels, node_x, node_w,
    coefficients, weights, level_start, end_x, end_w, measure,
):  # fmt: skip
    count = gaps.shape[0]
    fields = 0
    for _ in range(steps):
        table = map_gaps(gaps)
        kinds = np.empty(count, dtype=np.int64)
        offset = np.zeros(count + 1, dtype=np.int64)
        for k in range(count):
            wanted = digits / np.arcsinh(np.pi / (2 * table[k, ALPHA]))
            kind = 0
            while kind < counts.shape[0] - 1 and counts[kind] < wanted:
                kind += 1
            kinds[k] = kind
            offset[k + 1] = offset[k] + counts[kind]
        _, weight, slope, system, rhs, beyond, _ = assemble(
            table, kinds, offset, counts, start, square, eta, w, b, modes, width, panels, node_x,
            node_w, coefficients, weights, level_start, end_x, end_w, 1,
        )  # fmt: skip
        fields += 1
        factor = np.linalg.cholesky(system)
        load = _solve(factor, rhs[:, 0])
        unit = _solve(factor, rhs[:, 1])
        pressure = -(2 * np.pi * separation + weight @ load) / (weight @ unit)
        f = (-load - pressure * unit).reshape(-1, 1)
        opening = edge_openings(f, slope, kinds, offset, start, ends)[:, 0]
        value, _ = measure_at(gaps.ravel(), width, panels, measure)
        pull = np.empty(2 * count)
        limit = np.empty(2 * count)
        reach = 2 * longest if runners == 1 else longest
        for k in range(count):
            for side in range(2):
                e = 2 * k + side
                opening[e] -= np.sqrt(2 * slope[k, side]) * beyond[k, side, 0]
                pull[e] = critical * np.sqrt(value[e]) - opening[e]
                patch = table[k, 2 + side]  # the width of the patch beyond this end
                limit[e] = min(reach, 0.25 * min(table[k, 1] - table[k, 0], patch))
        step = running_step(matrix, d, pull, limit)
        for e in range(2 * count):
            if abs(step[e]) > 0.2 * longest and step[e] * last[e] <= 0:
                return gaps, last, runners, fields, True
        runners = 0
        moved = np.empty_like(gaps)
        for k in range(count):
            for side in range(2):
                e = 2 * k + side
                if opening[e] < -overlapping:
                    step[e] = limit[e]
                if abs(step[e]) > 0.5 * longest:
                    runners += 1
                moved[k, side] = gaps[k, side] + (step[e] if side == 0 else -step[e])
        gaps = moved
        last = step
        if runners == 0:
            break
        least = 2 * np.pi
        for k in range(count):
            after = gaps[k + 1, 0] if k + 1 < count else gaps[0, 0] + 2 * np.pi
            least = min(least, gaps[k, 1] - gaps[k, 0], after - gaps[k, 1])
        if least < smallest:
            break
    return gaps, last, runners, fields, False


@compiled
def _solve(factor, right):  # type: ignore[no-untyped-def]  # compiled
    """Forward and back substitution with the lower Cholesky factor."""
    n = right.shape[0]
    x = right.copy()
    for i in range(n):
        total = x[i]
        for j in range(i):
            total -= factor[i, j] * x[j]
        x[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= factor[i, i]
        for j in range(i):
            x[j] -= factor[i, j] * x[i]
    return x
