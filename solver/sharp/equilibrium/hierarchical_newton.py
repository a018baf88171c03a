"""Equilibrium of many gaps by Newton's iteration on the tree of gaps, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_elimination import eliminate_edges, newton_step
from adhesis.solver.sharp.equilibrium.griffith import (
    EdgeLaw,
    accept_correction,
    imbalance,
    raise_orders,
)
from adhesis.solver.sharp.equilibrium.last_correction import correct_gaps
from adhesis.solver.sharp.equilibrium.linear_exterior import Linearisation, linearise
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers, choose_orders
from adhesis.solver.sharp.tolerances import HIERARCHICAL_NEWTON_GROWTH, MOST_CORRECTIONS


class EquilibriumOfMany(NamedTuple):
    """Result of Newton's iteration on many gaps; otherwise as ``newton.Equilibrium``.

    Attributes
    ----------
    linearisation : Linearisation
        For windows on it, with the solution.
    rate : array, shape (2L,)
        If no equilibrium was found, the last correction.
    """

    found: bool
    gaps: Array
    linearisation: Linearisation
    rate: Array
    slope: float
    corrections: int


@compiled
def equilibrium_many(
    gaps: Array,
    prescribed: float,
    reach: float,
    least: Integers,
    strict: bool,
    law: EdgeLaw,
    model: FieldModel,
) -> EquilibriumOfMany:
    """Find the equilibrium in work that grows as the number of gaps, as ``newton.equilibrium``.

    Where the edges are not stable on the way, or the corrections hardly shrink, the iteration ends:
    of some 1,300 that came to a minimum four had not been stable, and one in a hundred had a
    correction half as large as the one before.
    """
    orders = raise_orders(choose_orders(map_gaps(gaps), model.digits, model.rules.counts), least)
    travelled = np.zeros(gaps.size)
    last = np.inf
    found = False
    steps = 0
    while True:
        steps += 1
        state, system = solve_many(gaps, prescribed, orders, 2, model)
        residual, drift = imbalance(state, law, model.panels)
        edges = eliminate_edges(state, system, residual, drift, model.rules)
        newton = newton_step(state, system, edges, model.device)
        size = np.abs(newton.step).max()
        if not np.isfinite(state.pressure):
            break
        if size <= law.field_error:
            found = newton.stable or not strict
            break
        if not strict and size <= law.rest_step:
            found = True
            break
        largest = HIERARCHICAL_NEWTON_GROWTH * last
        accepted, moved = accept_correction(gaps, newton.step, travelled, reach, largest)
        if not accepted or (strict and not newton.stable) or steps == MOST_CORRECTIONS:
            break
        gaps = moved
        # The iteration converges quadratically. A correction that is expected to be no larger than
        # the error of the field is left out: it would cost as much as this one.
        expected = size * size / law.longest_step
        if last < np.inf:
            expected = size * (size / last) ** 2
        if newton.stable and expected <= law.field_error:
            steps += 1
            state, system = correct_gaps(gaps, prescribed, state, system, newton.change, model)
            found = np.isfinite(state.pressure)
            break
        last = size
    rate = newton.rate if found else newton.step
    linearisation = linearise(state, system, edges)
    return EquilibriumOfMany(found, gaps, linearisation, rate, newton.slope, steps)
