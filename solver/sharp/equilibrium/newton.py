"""Equilibrium of the edges by Newton's iteration, compiled, with its stability and its slope."""

from __future__ import annotations

from typing import Any

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.griffith import (
    Law,
    at_least,
    imbalance,
    moved_gaps,
    narrowest,
    symmetric,
    tangent_of,
)
from adhesis.solver.sharp.field.cholesky import is_definite
from adhesis.solver.sharp.field.dense_solver import solve
from adhesis.solver.sharp.field.solution import PlainSolution, Solution, edge_openings, plain
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules, choose_kinds

_NEWTON_LIMIT = 8  # corrections before an equilibrium counts as lost
_SHARE = 0.01  # of what an equilibrium may move with the error of the field: so little is nothing
_KNOWN = 1e-3  # a tangent that changes by less than this share in a last correction serves after it


@compiled
def _faint(of: Solution, residual: Array, law: Law) -> bool:
    """Whether the force on every edge is that of rounding."""
    for e in range(residual.shape[0]):
        if not abs(residual[e] * (2 * of.opening[e] - residual[e])) <= law.faint:
            return False
    return True


@compiled
def equilibrium(
    gaps: Array,
    prescribed: float,
    reach: float,
    least: Kinds,
    patient: bool,
    law: Law,
    rules: Rules,
    panels: Panels,
) -> tuple[bool, Array, PlainSolution, Array, float, int]:
    """Newton's iteration for C_e = C_c from nearby edges.

    Returns whether a stable equilibrium was found with no edge moving further than ``reach``, its
    gaps, its solution, the rate dn/dd of every edge along the branch (d is what is prescribed),
    dY/dd along it (Y is p, under a load q0 s), and the number of corrections. ``least`` are the
    least kinds of the gaps, or empty. If not ``patient``, edges out of equilibrium by no more than
    ``law.near``, or by forces that are rounding, are taken as they are.

    Raises
    ------
    LinAlgError
        If a tangent is singular.
    """
    at = gaps
    kinds = at_least(choose_kinds(map_gaps(gaps), law.digits, rules.counts), least)
    travelled = np.zeros(gaps.size)
    last = np.inf
    found = False
    rate: Any = np.empty(0)
    slope = np.nan
    steps = 0
    settled = max(law.settled, _SHARE * law.coarse)
    while True:
        steps += 1
        of = solve(at, prescribed, law.hold, kinds, 2, rules, panels)
        if not np.isfinite(of.pressure):
            break
        residual, drift = imbalance(of, law, panels)
        tangent, by_edge = tangent_of(of, drift, rules)
        step: Any = np.linalg.solve(tangent, -residual)  # numpy promises some float
        size = np.abs(step).max()
        # The field has steps of the size of its error, where panels or modes change: an iteration
        # to and fro across one of them is at its end.
        stalled = size <= law.coarse and size > 0.3 * last
        if size <= settled or stalled:
            _, matrix = symmetric(of, tangent, law.overlapping)
            found = is_definite(matrix) or not patient
            break
        if not patient and (size <= law.near or _faint(of, residual, law)):
            found = True
            break
        travelled += step
        # not written as > : a size that is no number is a failure, too
        within = size <= reach and size <= 2 * last and np.abs(travelled).max() <= reach
        if not within or steps == _NEWTON_LIMIT:
            break
        moved = moved_gaps(at, step)
        if not narrowest(moved) > 0:
            break
        at = moved
        # The iteration converges quadratically: the next correction, and by what share the tangent
        # changes until then, are known beforehand.
        share = (size / last) ** 2
        if last < np.inf and size * share <= settled and share <= _KNOWN:
            _, matrix = symmetric(of, tangent, law.overlapping)
            if is_definite(matrix) or not patient:
                steps += 1
                of = solve(at, prescribed, law.hold, kinds, 2, rules, panels)
                found = np.isfinite(of.pressure)
                break
        last = size
    if found:
        by_prescribed = -2 * np.pi / of.resistance
        unit = np.empty((of.f.shape[0], 1))
        for i in range(of.f.shape[0]):
            unit[i, 0] = -by_prescribed * of.solved[i, 1]
        opening = edge_openings(unit, of.slope, of.kinds, of.offset, rules.start, rules.ends)
        rate = np.linalg.solve(tangent, -opening[:, 0])
        slope = by_prescribed if of.share != 0 else of.unit_mean / (2 * np.pi)
        for e in range(rate.shape[0]):
            slope += by_edge[e] * (rate[e] if e % 2 == 0 else -rate[e])
    return found, at, plain(of), rate, slope, steps
