"""Moving edges, compiled: equilibrium by Newton, stability, and descent along a jump."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from solver.compiled import compiled
from solver.profile import Array
from solver.sharp.box import off_saddle, running_step
from solver.sharp.coordinate import LEFT, LEFT_PATCH, RIGHT, RIGHT_PATCH, map_gaps
from solver.sharp.field import (
    Kinds,
    PlainSolution,
    Rules,
    Solution,
    choose_kinds,
    derivatives,
    edge_openings,
    plain,
    solve,
)
from solver.sharp.linear import is_definite
from solver.sharp.source import Panels, measure_at

_NEWTON_LIMIT = 8  # corrections before an equilibrium counts as lost
_REUSES = 8  # running steps that share one tangent
_NOISE = 1e-3  # a rise of the energy below this share of the work done both ways is rounding
_LEAST_SHARE = 0.02  # descent steps are not cut below this share of the longest

# How a descent ended.
RESTING, NARROW, UNFINISHED = 0, 1, 2


class Law(NamedTuple):
    """What moves the edges; lengths in θ.

    Attributes
    ----------
    critical : float
        Critical opening on a flat piece.
    digits : float
        -ln of the relative accuracy of the field.
    settled : float
        A correction this small ends Newton's iteration.
    coarse : float
        So far an equilibrium may move with the error of the field; no smaller than ``settled``.
    near : float
        Descent steps shorter than this are left to Newton's iteration.
    longest : float
        Longest step of a running edge.
    smallest : float
        Narrower patches and gaps are gone.
    overlapping : float
        An opening this far below zero is an overlap that descent cannot weigh.
    """

    critical: float
    digits: float
    settled: float
    coarse: float
    near: float
    longest: float
    smallest: float
    overlapping: float


@compiled
def _narrowest(gaps: Array) -> float:
    """Length of the shortest gap or patch."""
    table = map_gaps(gaps)
    least = 2 * np.pi
    for k in range(table.shape[0]):
        least = min(least, table[k, RIGHT] - table[k, LEFT], table[k, RIGHT_PATCH])
    return least


@compiled
def _residual(of: Solution, law: Law, panels: Panels) -> tuple[Array, Array]:
    """C_e - C_c at every edge; positive where contact recedes. And the derivative of C_c by θ."""
    edges = of.opening.shape[0]
    residual = np.empty(edges)
    drift = np.empty(edges)
    for e in range(edges):
        measure, slope = measure_at(of.table[e // 2, LEFT + e % 2], panels)
        root = np.sqrt(measure)
        residual[e] = of.opening[e] - law.critical * root
        drift[e] = law.critical * slope / (2 * root)
    return residual, drift


@compiled
def _tangent(of: Solution, drift: Array, rules: Rules) -> tuple[Array, Array]:
    """∂(C_e - C_c)/∂n_f, n the outward motion of the contact, and ∂p/∂θ_f."""
    matrix, pressure = derivatives(of, rules)
    for e in range(matrix.shape[0]):
        matrix[e, e] -= drift[e]
        for f in range(1, matrix.shape[0], 2):
            matrix[e, f] = -matrix[e, f]
    return matrix, pressure


@compiled
def _symmetric(of: Solution, tangent: Array, overlapping: float) -> tuple[Array, Array]:
    """Scale factors d and the symmetric matrix d_e tangent_ef / d_f."""
    n = tangent.shape[0]
    d = np.sqrt(np.maximum(of.opening, overlapping))
    matrix = np.empty((n, n))
    for e in range(n):
        for f in range(e + 1):
            value = 0.5 * (tangent[e, f] * d[e] / d[f] + tangent[f, e] * d[f] / d[e])
            matrix[e, f] = value
            matrix[f, e] = value
    return d, matrix


@compiled
def _moved(gaps: Array, step: Array) -> Array:
    """Gaps after an outward motion ``step`` of the contact at every edge."""
    out = np.empty_like(gaps)
    for k in range(gaps.shape[0]):
        out[k, 0] = gaps[k, 0] + step[2 * k]
        out[k, 1] = gaps[k, 1] - step[2 * k + 1]
    return out


@compiled
def _at_least(kinds: Kinds, least: Kinds) -> Kinds:
    """``kinds``, none below ``least`` (which is empty for no bound).

    While edges move towards one state, a gap must not lose modes again, or the field's error would
    drive them to and fro.
    """
    if least.shape[0] == kinds.shape[0]:
        return np.maximum(kinds, least)
    return kinds


@compiled
def equilibrium(
    gaps: Array,
    separation: float,
    reach: float,
    least: Kinds,
    patient: bool,
    law: Law,
    rules: Rules,
    panels: Panels,
) -> tuple[bool, Array, PlainSolution, Array, float, int]:
    """Newton's iteration for C_e = C_c from nearby edges.

    Returns whether a stable equilibrium was found with no edge moving further than ``reach``, its
    gaps, its solution, the rate dn/d(q0 s) of every edge along the branch, dp/d(q0 s) along it, and
    the number of corrections. ``least`` are the least kinds of the gaps, or empty. If not
    ``patient``, edges out of equilibrium by no more than ``law.near`` are taken as they are.

    Raises
    ------
    LinAlgError
        If a tangent is singular.
    """
    at = gaps
    kinds = _at_least(choose_kinds(map_gaps(gaps), law.digits, rules.counts), least)
    travelled = np.zeros(gaps.size)
    last = np.inf
    found = False
    rate: Any = np.empty(0)
    slope = np.nan
    steps = 0
    while True:
        steps += 1
        of = solve(at, separation, kinds, 2, rules, panels)
        residual, drift = _residual(of, law, panels)
        tangent, by_edge = _tangent(of, drift, rules)
        step: Any = np.linalg.solve(tangent, -residual)  # numpy promises some float
        size = np.abs(step).max()
        # The field has steps of the size of its error, where panels or modes change: an iteration
        # to and fro across one of them is at its end.
        stalled = size <= law.coarse and size > 0.3 * last
        if size <= law.settled or stalled:
            _, matrix = _symmetric(of, tangent, law.overlapping)
            found = is_definite(matrix) or not patient
            break
        if not patient and size <= law.near:
            found = True
            break
        travelled += step
        # not written as > : a size that is no number is a failure, too
        within = size <= reach and size <= 2 * last and np.abs(travelled).max() <= reach
        if not within or steps == _NEWTON_LIMIT:
            break
        last = size
        moved = _moved(at, step)
        if not _narrowest(moved) > 0:
            break
        at = moved
    if found:
        by_separation = -2 * np.pi / of.unit_mean
        unit = np.empty((of.f.shape[0], 1))
        for i in range(of.f.shape[0]):
            unit[i, 0] = -by_separation * of.solved[i, 1]
        opening = edge_openings(unit, of.slope, of.kinds, of.offset, rules.start, rules.ends)
        rate = np.linalg.solve(tangent, -opening[:, 0])
        slope = by_separation
        for e in range(rate.shape[0]):
            slope += by_edge[e] * (rate[e] if e % 2 == 0 else -rate[e])
    return found, at, plain(of), rate, slope, steps


@compiled
def _limits(table: Array, longest: float) -> Array:
    """Longest step of each edge: ``longest``, or a quarter of the gap or patch it may close."""
    limit = np.empty(2 * table.shape[0])
    for k in range(table.shape[0]):
        length = table[k, RIGHT] - table[k, LEFT]
        for side in range(2):
            limit[2 * k + side] = min(longest, 0.25 * min(length, table[k, LEFT_PATCH + side]))
    return limit


@compiled
def descend(
    gaps: Array, separation: float, most: int, least: Kinds, law: Law, rules: Rules, panels: Panels
) -> tuple[Array, int, int, int, Kinds]:
    """Descend in energy at fixed separation, for at most ``most`` steps.

    Edges out of equilibrium run in the direction in which the energy falls, all at the same speed
    (their limit, twice as long for one that runs alone); edges near equilibrium follow them by
    Newton's step. A patch or gap loses at most a quarter of its length to each edge. While edges
    run, a tangent serves several steps, unless an edge turns; the openings are always fresh.

    Returns
    -------
    gaps, how it ended, fields, tangents, kinds
        RESTING where the steps have become short, NARROW where a patch or gap is below the smallest
        length, UNFINISHED after the last step.
    """
    edges = 2 * gaps.shape[0]
    fields = 0
    tangents = 0
    reuses = 0
    runners = 0
    share = 1.0  # of the longest step; less after a step that raised the energy
    before = gaps
    last = np.zeros(edges)
    force = np.zeros(edges)  # of the energy on each edge, before the last step
    d = np.zeros(edges)
    matrix = np.zeros((edges, edges))
    kinds = least
    while fields < most:
        fields += 1
        held = runners > 0 and reuses < _REUSES
        table = map_gaps(gaps)
        kinds = _at_least(choose_kinds(table, law.digits, rules.counts), kinds)
        of = solve(gaps, separation, kinds, 1 if held else 2, rules, panels)
        residual, drift = _residual(of, law, panels)
        # the energy's change over the last step, in units of π/8: dU/dn = C² - C_c²
        rise = 0.0
        fall = 0.0
        fresh = np.empty(edges)
        for e in range(edges):
            fresh[e] = residual[e] * (2 * of.opening[e] - residual[e])
            work = 0.5 * (force[e] + fresh[e]) * last[e]
            rise += work
            fall += abs(work)
        if rise > _NOISE * fall and share > _LEAST_SHARE and fields > 1:
            gaps = before
            share *= 0.5
            runners = 0
            last = np.zeros(edges)
            continue
        if fall > 0:
            share = min(1.0, 2 * share)
        force = fresh
        longest = share * law.longest
        if held:
            reuses += 1
            limit = _limits(table, 2 * longest if runners == 1 else longest)
            step = running_step(matrix, d, -residual, limit)
            turns = False
            for e in range(edges):
                if abs(step[e]) > 0.2 * longest and step[e] * last[e] <= 0:
                    turns = True
            if turns:
                runners = 0
                last = np.zeros(edges)
                continue
        else:
            tangents += 1
            reuses = 0
            limit = _limits(table, longest)
            tangent, _ = _tangent(of, drift, rules)
            d, matrix = _symmetric(of, tangent, law.overlapping)
            step = running_step(matrix, d, -residual, limit)
        for e in range(edges):
            # Where surfaces would overlap beside an edge there is nothing to weigh: contact grows.
            if of.opening[e] < -law.overlapping:
                step[e] = limit[e]
        size = np.abs(step).max()
        if size <= law.coarse and not held and not is_definite(matrix):
            step = off_saddle(matrix, d, limit)
            size = np.abs(step).max()
        runners = 0
        for e in range(edges):
            if abs(step[e]) > 0.5 * longest:
                runners += 1
        before = gaps
        gaps = _moved(gaps, step)
        last = step
        if _narrowest(gaps) < law.smallest:
            return gaps, NARROW, fields, tangents, kinds
        if size < law.near:
            return gaps, RESTING, fields, tangents, kinds
    return gaps, UNFINISHED, fields, tangents, kinds
