"""Forces on a few edges along a step of all edges, compiled.

The derivative of one edge's force along a step of all edges needs one column of the tangent only:
the energy's second derivatives are symmetric, and translation invariance gives the diagonal. So it
costs one right-hand side, where the whole tangent costs one for every edge.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.cholesky import solve_factored
from adhesis.solver.sharp.field.edge_derivatives import derivatives
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.field.weight_function import (
    openings_by_edges,
    openings_by_translation,
    singular_loads,
)
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers
from adhesis.solver.sharp.tolerances import CUBIC_ERROR, FORCE_MARGIN, FORCE_SAMPLES


@compiled
def first_zero(departing: float, departing_rate: float, arriving: float, rate: float) -> float:
    """Find the share of a step after which a force has fallen to nothing, or nearly; 1 if never.

    The force is the cubic with these values and derivatives at both ends.
    """
    bend = 3 * (arriving - departing) - 2 * departing_rate - rate
    twist = 2 * (departing - arriving) + departing_rate + rate
    values = np.empty(FORCE_SAMPLES + 1)
    for i in range(FORCE_SAMPLES + 1):
        t = i / FORCE_SAMPLES
        values[i] = departing + t * (departing_rate + t * (bend + t * twist))
    # The cubic errs by h⁴/384 of the fourth derivative, ``twist`` is h³/6 of the third.
    least = max(FORCE_MARGIN * np.abs(values).max(), CUBIC_ERROR * abs(twist))
    for i in range(1, FORCE_SAMPLES + 1):
        if values[i] < least and values[i] < values[i - 1]:
            return max(i - 1, 1) / FORCE_SAMPLES
    return 1.0


@compiled
def force_derivatives(
    state: Solution, wanted: Integers, rules: GaussRules, rows: Array, known: Integers
) -> None:
    """Compute C_e ∂C_e/∂n_f of the edges ``wanted``, n outwards, into their ``rows``.

    There is a row for each edge e. Those that are ``known``, which is not zero, are left. The
    solution must be one with S and S'.
    """
    opening, factor = state.opening, state.factor
    edges = opening.shape[0]
    missing = 0
    for e in wanted:
        missing += 1 if known[e] == 0 else 0
    if missing == 0:
        return
    if state.exterior.present:  # its terms are those of the whole tangent
        tangent, _ = derivatives(state, rules)
        for e in range(edges):
            for f in range(edges):
                rows[e, f] = opening[e] * tangent[e, f] * (1 - 2 * (f % 2))
        known[:] = 1
        return
    together = openings_by_translation(state, rules)
    edge = np.empty(1, dtype=np.int64)
    for e in wanted:
        if known[e] != 0:
            continue
        outwards = 1 - 2 * (e % 2)
        edge[0] = e
        load, area = singular_loads(state, edge, 1, rules)
        solve_factored(factor, load)
        by_edge, _ = openings_by_edges(state, edge, load, area, rules)
        diagonal = opening[e] * together[e] * outwards
        for f in range(edges):
            if f != e:
                # C_e ∂C_e/∂n_f = C_f ∂C_f/∂n_e, both n outwards
                by = opening[f] * by_edge[f, 0] * outwards
                rows[e, f] = by
                diagonal -= by * outwards * (1 - 2 * (f % 2))
        rows[e, e] = diagonal
        known[e] = 1
