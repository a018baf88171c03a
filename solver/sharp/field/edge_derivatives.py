"""Compute the derivatives of the field of ``dense_solver`` with respect to the edges.

Those of other edges follow from the weight functions (``weight_function``), an edge's own from
translation invariance: moving all edges together is moving the profile, whose source is S_full'.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled_for_both
from adhesis.solver.sharp.field.cholesky import padded, solve_factored
from adhesis.solver.sharp.field.solution import Solution
from adhesis.solver.sharp.field.weight_function import (
    openings_by_edges,
    openings_by_translation,
    singular_loads,
)
from adhesis.solver.sharp.gap.quadrature import GaussRules


@compiled_for_both
def derivatives(solution: Solution, rules: GaussRules) -> tuple[Array, Array]:
    """Compute ∂C_e/∂θ_f, shape (2L, 2L), and ∂Y/∂θ_f, shape (2L,), of a solution with S and S'.

    Y is p, under a load q0 s.
    """
    edges = solution.opening.shape[0]
    every = np.arange(edges)
    load, area = singular_loads(solution, every, padded(edges), rules)
    if solution.exterior.present:
        load[:, :edges] += solution.exterior.load
        area += solution.exterior.area
    solve_factored(solution.factor, load)
    by_edge, conjugate = openings_by_edges(solution, every, load, area, rules)
    together = openings_by_translation(solution, rules)
    for e in range(edges):
        total = 0.0
        for f in range(edges):
            if f != e:
                total += by_edge[e, f]
        by_edge[e, e] = together[e] - total
    if solution.exterior.present:
        # the ends of the exterior stay
        typical = 0.0
        for e in range(edges - 2):
            typical = max(typical, abs(by_edge[e, e]))
        by_edge[edges - 2 :] = 0.0
        by_edge[:, edges - 2 :] = 0.0
        by_edge[edges - 2, edges - 2] = typical
        by_edge[edges - 1, edges - 1] = -typical
        conjugate[edges - 2 :] = 0.0
    return by_edge, conjugate
