"""Equilibrium of many gaps by Newton's iteration on the tree of gaps, compiled."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_elimination import newton_step, yielding_gaps
from adhesis.solver.sharp.equilibrium.griffith import (
    Law,
    at_least,
    imbalance,
    moved_gaps,
    narrowest,
)
from adhesis.solver.sharp.equilibrium.last_correction import landed
from adhesis.solver.sharp.equilibrium.linear_exterior import About, at_rest
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules, choose_kinds

_NEWTON_LIMIT = 8  # corrections before an equilibrium counts as lost
_SHRINKS = 0.7  # share of the last correction to which the next one has to come down


@compiled
def equilibrium_many(
    gaps: Array,
    prescribed: float,
    reach: float,
    least: Kinds,
    patient: bool,
    law: Law,
    rules: Rules,
    panels: Panels,
) -> tuple[bool, Array, About, Array, float, int]:
    """Find the equilibrium in work that grows as the number of gaps.

    Otherwise as ``newton.equilibrium``.

    With the solution comes what windows are opened with. Where the edges are not stable on the
    way, or the corrections hardly shrink, the iteration is not gone on with: of some 1,300 that
    came to a minimum four had not been stable, and one in a hundred had a correction half as large
    as the one before. Then the last correction takes the place of the rate.
    """
    at = gaps
    kinds = at_least(choose_kinds(map_gaps(gaps), law.digits, rules.counts), least)
    travelled = np.zeros(gaps.size)
    last = np.inf
    found = False
    steps = 0
    while True:
        steps += 1
        of, parts = solve_many(at, prescribed, law.hold, kinds, law.digits, 2, rules, panels)
        residual, drift = imbalance(of, law, panels)
        edges = yielding_gaps(of, parts, residual, drift, rules)
        step, rate, slope, stable, change = newton_step(of, parts, edges, law.hold)
        size = np.abs(step).max()
        if not np.isfinite(of.pressure):
            break
        if size <= law.coarse:
            found = stable or not patient
            break
        if not patient and size <= law.near:
            found = True
            break
        travelled += step
        # not written as > : a size that is no number is a failure, too
        within = size <= reach and size <= _SHRINKS * last and np.abs(travelled).max() <= reach
        if not within or (patient and not stable) or steps == _NEWTON_LIMIT:
            break
        moved = moved_gaps(at, step)
        if not narrowest(moved) > 0:
            break
        at = moved
        # The iteration converges quadratically. A correction that is expected to be no larger than
        # what the field's error makes is not asked for: it would cost as much as this one.
        expected = size * (size / last) ** 2 if last < np.inf else size * size / law.longest
        if stable and expected <= law.coarse:
            steps += 1
            of, parts = landed(at, prescribed, law.hold, of, parts, change, rules, panels)
            found = np.isfinite(of.pressure)
            break
        last = size
    return found, at, at_rest(of, parts, edges), rate if found else step, slope, steps
