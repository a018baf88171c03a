"""Descent along a jump, compiled."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.bound_constrained_step import off_saddle, running_step
from adhesis.solver.sharp.descent.linear_kinetics import flow_step, hessian, leaving_step
from adhesis.solver.sharp.equilibrium.griffith import (
    EdgeLaw,
    edge_tangent,
    imbalance,
    move_edges,
    raise_orders,
    shortest_length,
    step_limits,
    symmetrise,
)
from adhesis.solver.sharp.field.cholesky import is_definite
from adhesis.solver.sharp.field.dense_solver import solve, solve_again
from adhesis.solver.sharp.field.exterior import Exterior
from adhesis.solver.sharp.field.force_along_step import first_zero, force_derivatives
from adhesis.solver.sharp.field.solution import FieldModel, Solution
from adhesis.solver.sharp.gap.conformal_map import LEFT, map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers, choose_orders

# Further running steps with one tangent: of an edge that runs alone only the size of its step
# depends on it, of several the direction, too.
_REUSES_ALONE = 8
_REUSES = 2
# Longer steps, in longest unchecked ones, are looked at for a minimum that they leap over.
_UNCHECKED_ALONE = 2.0  # of an edge that runs alone
_STRIDE = 3.0  # longest of all
_STRIDE_ALONE = 6.0
_RUNS = 0.25  # edges that move by this share of the longest motion run
# While others run an edge stands until it is so far from its place, in longest steps of its own:
# what belongs to gaps that have not changed is not computed anew.
_STANDS = 0.01
_NOISE = 1e-3  # a rise of the energy below this share of the work done both ways is rounding
_TIE = 1e-3  # two ways off a saddle whose gains differ by less are equal
_LEAST_SHARE = 0.02  # descent steps are not cut below this share of the longest
# A lone edge that runs to and fro leaps over a minimum that no look at its steps shows.
_TO_AND_FRO = 8  # turns after which the steps of a descent become shorter,
_SHORTENED = 0.8  # each time to this share

_MET = 0.4  # edges this close to another descent's track, in longest steps, are on it
_LOOKS = 3  # in so many looks one after the other
_LOOK_EVERY = 2  # fields

# How a descent ended.
RESTING, NARROW, UNFINISHED, LOST, MET = 0, 1, 2, 3, 4


@compiled
def descend(
    gaps: Array,
    prescribed: float,
    most: int,
    least: Integers,
    equal_speeds: bool,
    law: EdgeLaw,
    model: FieldModel,
    exterior: Exterior,
    track: Array,
    astray: bool,
) -> tuple[Array, int, int, int, Integers, Array, bool, Array]:
    """Descend in energy, d being ``prescribed``, for at most ``most`` steps.

    Edges move in proportion to their excess energy release rates, by no more than the longest step
    and a quarter of the gap or patch that they may close. Or, for comparison, with
    ``equal_speeds``: edges out of equilibrium run, all at the same speed (their limit, twice as
    long for one that runs alone), and edges near equilibrium follow them by Newton's step.

    While edges run, a tangent serves several steps, of several edges three, unless an edge turns;
    the openings are always fresh. A step that raised the energy is taken back and halved.

    ``track``, shape (n, 2L), holds the edges that another descent went through. One that has been
    away from it (``astray``) and comes back to it has met it.

    Returns
    -------
    gaps, how it ended, fields, tangents, orders, passed, astray, taken
        RESTING where the steps have become short, NARROW where a patch or gap is below the smallest
        length, UNFINISHED after the last step, LOST where the edges have no field, MET where they
        are on the track again. ``passed`` is the way of this descent, as ``track``; ``taken`` the
        force that the outward motion of each edge (columns) took from every edge (rows).
    """
    rules, panels = model.rules, model.panels
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
    values = np.zeros(edges)
    matrix = np.zeros((edges, edges))  # tangent, or eigenvectors of the Hessian
    orders = least
    stride = 0.0
    checked = np.empty(0, dtype=np.int64)  # edges that ran far in the last step
    departed = np.empty(0)  # how their forces changed at its start
    rows = np.zeros((edges, edges))  # how forces change with the edges, of those edges
    known = np.zeros(edges, dtype=np.int64)  # that are not zero here
    passed = np.empty((64, edges))
    passed[0] = gaps.ravel()
    count = 1
    looks = 0
    turned = 0
    taken = np.zeros((edges, edges))
    while fields < most:
        fields += 1
        held = runners > 0 and reuses < (_REUSES_ALONE if runners == 1 else _REUSES)
        table = map_gaps(gaps)
        orders = raise_orders(choose_orders(table, model.digits, rules.counts), orders)
        if fields == 1:
            of = solve(gaps, prescribed, orders, 2, model, exterior)
        else:
            of = solve_again(gaps, prescribed, orders, model, exterior, of)
        if not np.isfinite(of.pressure):
            return gaps, LOST, fields, tangents, orders, passed[:count], astray, taken
        residual, drift = imbalance(of, law, panels)
        known[:] = 0
        # the energy's change over the last step, in units of π/8: dU/dn = C² - C_c²; where the
        # surfaces overlap, C < 0, contact grows all the same
        rise = 0.0
        fall = 0.0
        fresh = np.empty(edges)
        for e in range(edges):
            critical = of.opening[e] - residual[e]
            fresh[e] = of.opening[e] * abs(of.opening[e]) - critical * critical
            work = 0.5 * (force[e] + fresh[e]) * last[e]
            rise += work
            fall += abs(work)
        if checked.shape[0] > 0:
            force_derivatives(of, checked, rules, rows, known)
            arrived = _rates(of, residual, drift, last, checked, rows)
            clear = 1.0
            for i in range(checked.shape[0]):
                e = checked[i]
                onwards = -np.sign(last[e])
                clear = min(
                    clear,
                    first_zero(onwards * force[e], departed[i], onwards * fresh[e], arrived[i]),
                )
            checked = np.empty(0, dtype=np.int64)
            if clear < 1:
                gaps = move_edges(before, clear * last)
                _take(rows, clear * last, taken)
                passed[count - 1] = gaps.ravel()
                stride = 0.0
                runners = 0
                last = np.zeros(edges)
                continue
        if rise > _NOISE * fall and share > _LEAST_SHARE and fields > 1:
            gaps = before
            count -= 1
            share *= 0.5
            runners = 0
            last = np.zeros(edges)
            continue
        if fall > 0:
            share = min(1.0, 2 * share)
        _take(rows, last, taken)
        force = fresh
        pace = _SHORTENED ** max(turned - _TO_AND_FRO, 0)
        longest = share * max(pace, _LEAST_SHARE) * law.longest_step
        unchecked = _UNCHECKED_ALONE * longest if runners == 1 else longest
        reach = unchecked
        if runners > 0:
            stride = min(max(2 * stride, 1.0), _STRIDE_ALONE if runners == 1 else _STRIDE)
            reach = max(reach, stride * longest)
        limit = step_limits(table, reach)
        if track.shape[0] > 0 and fields % _LOOK_EVERY == 0:
            away = _distance(gaps.ravel(), track, law.longest_step)
            off = away > _MET * law.longest_step
            astray = astray or off
            looks = looks + 1 if astray and not off else 0
            if looks == _LOOKS:
                return gaps, MET, fields, tangents, orders, passed[:count], astray, taken
        if held:
            reuses += 1
        else:
            tangents += 1
            reuses = 0
            tangent, _ = edge_tangent(of, drift, rules)
            for e in range(edges):
                for f in range(edges):
                    rows[e, f] = of.opening[e] * tangent[e, f]
                rows[e, e] += of.opening[e] * drift[e] * (1 - 2 * (e % 2))
            known[:] = 1
            if equal_speeds:
                d, matrix = symmetrise(of, tangent, law.overlap_limit)
            else:
                values, matrix = np.linalg.eigh(
                    hessian(np.maximum(of.opening, 0.0), residual, drift, tangent)
                )
        if equal_speeds:
            step = running_step(matrix, d, -residual, limit)
        else:
            step = flow_step(values, matrix, -force, limit, law.force_error)
        if held:
            turns = False
            for e in range(edges):
                if abs(step[e]) > 0.2 * reach and step[e] * last[e] <= 0:
                    turns = True
            if turns:
                turned += 1 if runners == 1 else 0
                runners = 0
                last = np.zeros(edges)
                continue
        for e in range(edges):
            # Where surfaces would overlap beside an edge there is nothing to weigh: contact grows.
            if of.opening[e] < -law.overlap_limit:
                step[e] = limit[e]
        size = np.abs(step).max()
        if size <= law.field_error and not held:
            if equal_speeds:
                if not is_definite(matrix):
                    step = off_saddle(matrix, d, limit)
            elif values[0] < 0:
                way = leaving_step(values, matrix, limit, _places(table, law.origin))
                fields += 2
                onwards = _gain(gaps, way, prescribed, orders, law, model, exterior)
                backwards = _gain(gaps, -way, prescribed, orders, law, model, exterior)
                if max(onwards, backwards) > 0:
                    step = way if onwards >= backwards * (1 - _TIE) else -way
            size = np.abs(step).max()
        if not size < np.inf:
            return gaps, LOST, fields, tangents, orders, passed[:count], astray, taken
        runners = 0
        if size > 0.5 * longest:
            running = np.flatnonzero(np.abs(step) > max(_RUNS * size, 0.5 * longest))
            runners = running.shape[0]
            for e in range(edges):
                if abs(step[e]) < _STANDS * limit[e]:
                    step[e] = 0.0
            if size > unchecked:
                if np.any(force[running] * step[running] >= 0):  # pulled along by others
                    step *= unchecked / size
                else:
                    checked = running
                    force_derivatives(of, checked, rules, rows, known)
                    departed = _rates(of, residual, drift, step, checked, rows)
        before = gaps
        gaps = move_edges(gaps, step)
        last = step
        if count == passed.shape[0]:
            longer = np.empty((2 * count, edges))
            longer[:count] = passed
            passed = longer
        passed[count] = gaps.ravel()
        count += 1
        if shortest_length(gaps) < law.smallest:
            _take(rows, last, taken)
            return gaps, NARROW, fields, tangents, orders, passed[:count], astray, taken
        if size < law.rest_step:
            return gaps, RESTING, fields, tangents, orders, passed[:count], astray, taken
    return gaps, UNFINISHED, fields, tangents, orders, passed[:count], astray, taken


@compiled
def _take(rows: Array, step: Array, taken: Array) -> None:
    """Add the force that the motion of each edge takes from every edge; ``rows`` as above."""
    for e in range(step.shape[0]):
        for f in range(step.shape[0]):
            taken[e, f] += 2 * rows[e, f] * step[f]


@compiled
def _rates(
    of: Solution, residual: Array, drift: Array, way: Array, edges: Integers, rows: Array
) -> Array:
    """How the force on each of ``edges``, along its own way, changes along the way of all.

    ``rows`` are those of :func:`force_derivatives`.
    """
    rates = np.empty(edges.shape[0])
    for i in range(edges.shape[0]):
        e = edges[i]
        total = 0.0
        for f in range(way.shape[0]):
            total += rows[e, f] * way[f]
        critical = of.opening[e] - residual[e]
        rate = critical * drift[e] * (1 - 2 * (e % 2)) * way[e] - np.sign(of.opening[e]) * total
        rates[i] = 2 * rate * np.sign(way[e])
    return rates


@compiled
def _distance(at: Array, track: Array, longest: float) -> float:
    """Largest distance of an edge from the track, where that is nearest; inf if it is far."""
    least = np.inf
    for i in range(track.shape[0] - 1):
        along = 0.0
        square = 0.0
        widest = 0.0
        for e in range(at.shape[0]):
            way = track[i + 1, e] - track[i, e]
            off = at[e] - track[i, e]
            widest = max(widest, abs(way), 0.25 * abs(off))
            if widest > 1.2 * _STRIDE_ALONE * longest:  # far, or between the tracks of two descents
                break
            along += way * off
            square += way * way
        if widest > 1.2 * _STRIDE_ALONE * longest or square == 0:
            continue
        share = min(max(along / square, 0.0), 1.0)
        worst = 0.0
        for e in range(at.shape[0]):
            way = track[i + 1, e] - track[i, e]
            worst = max(worst, abs(at[e] - track[i, e] - share * way))
        least = min(least, worst)
    return least


@compiled
def _gain(
    gaps: Array,
    step: Array,
    prescribed: float,
    orders: Integers,
    law: EdgeLaw,
    model: FieldModel,
    exterior: Exterior,
) -> float:
    """Force along ``step`` after it, from a state without force: positive where energy falls."""
    of = solve(move_edges(gaps, step), prescribed, orders, 1, model, exterior)
    residual, _ = imbalance(of, law, model.panels)
    gain = 0.0
    for e in range(step.shape[0]):
        gain -= residual[e] * (2 * of.opening[e] - residual[e]) * step[e]
    return gain


@compiled
def _places(table: Array, origin: float) -> Array:
    """Distance of every edge to the right of ``origin``, in [0, 2π)."""
    out = np.empty(2 * table.shape[0])
    for k in range(table.shape[0]):
        for side in range(2):
            out[2 * k + side] = (table[k, LEFT + side] - origin) % (2 * np.pi)
    return out
