"""Descent of many gaps in windows: where edges run, the rest responding linearly; compiled.

In a jump a few edges run at a time. The gaps around them are a window whose edges descend as those
of few gaps do (``gradient_flow``); all other gaps are what the
window feels of them (``exterior``), their edges exterior_motion by their
tangent. After some steps, or when the window has come to rest, the others are put where their
tangent leads, everything is solved anew, and the next window is chosen: around the edge that is
furthest from its balance or, once all are near it, that Newton's step moves most.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.gradient_flow import (
    LOST,
    NARROW,
    RESTING,
    UNFINISHED,
    descend,
)
from adhesis.solver.sharp.equilibrium.edge_elimination import eliminate_edges, newton_step
from adhesis.solver.sharp.equilibrium.griffith import (
    EdgeLaw,
    imbalance,
    move_edges,
    raise_orders,
    shortest_length,
    step_limits,
)
from adhesis.solver.sharp.equilibrium.linear_exterior import (
    Linearisation,
    exterior_motion,
    open_window,
)
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import Integers, choose_orders

_HALF_WIDTH = 4  # gaps of a window on each side of the edge that leads
_WIDEST = 48
_STEPS = 60  # steps in a window before everything is solved anew
_LOUD = 0.02  # imbalance, of C_c, above which the furthest edge leads
_CALM = 0.2  # an edge outside follows its tangent if that moves it by less, in longest steps
_NEWTON_STEPS = 12  # steps of all edges in a row


@compiled
def _leading_gap(residual: Array, step: Array, law: EdgeLaw) -> int:
    """Gap of the edge around which a window is put."""
    if np.abs(residual).max() > _LOUD * law.critical:
        return int(np.argmax(np.abs(residual))) // 2
    return int(np.argmax(np.abs(step))) // 2


@compiled
def descend_many(
    gaps: Array,
    prescribed: float,
    most: int,
    least: Integers,
    equal_speeds: bool,
    law: EdgeLaw,
    model: FieldModel,
) -> tuple[Array, int, int, int, Integers]:
    """As ``gradient_flow.descend``, for many gaps."""
    fields = 0
    tangents = 0
    count = gaps.shape[0]
    half = _HALF_WIDTH
    newton = 0
    orders = least
    while fields < most:
        table = map_gaps(gaps)
        orders = raise_orders(choose_orders(table, model.digits, model.rules.counts), orders)
        of, system = solve_many(gaps, prescribed, orders, 2, model)
        fields += 1
        tangents += 1
        if not np.isfinite(of.pressure):
            return gaps, LOST, fields, tangents, orders
        residual, drift = imbalance(of, law, model.panels)
        edges = eliminate_edges(of, system, residual, drift, model.rules)
        step, _, _, stable, _ = newton_step(of, system, edges, model.device)
        size = np.abs(step).max()
        if stable and size < law.rest_step:
            return move_edges(gaps, step), RESTING, fields, tangents, orders
        limit = step_limits(table, law.longest_step)
        if stable and newton < _NEWTON_STEPS and np.all(np.abs(step) <= limit):
            newton += 1
            gaps = move_edges(gaps, step)
            continue
        newton = 0
        width = min(2 * half + 1, count - 2)
        first = (_leading_gap(residual, step, law) - width // 2) % count
        calm = _CALM * law.longest_step
        about = Linearisation(of, system.inverse, system.weights, edges)
        window, exterior, outside = open_window(about, first, width, calm, law, model)
        window_orders = np.zeros(width + 1, dtype=np.int64)
        for i in range(width):
            window_orders[i] = orders[(first + i) % count]
        moved, ended, moved_orders = window, LOST, window_orders
        followed = np.empty(0)
        stable = outside.factor.negative == 0
        while ended == LOST:
            if not stable:  # with all edges outside held
                window, exterior, outside = open_window(about, first, width, 0.0, law, model)
            moved, ended, some, more, moved_orders, _, _, _ = descend(
                window, prescribed, min(_STEPS, most - fields), window_orders, equal_speeds, law,
                model, exterior, np.empty((0, window.size)), False,
            )  # fmt: skip
            fields += some
            tangents += more
            if ended != LOST:
                followed = exterior_motion(
                    moved, prescribed, moved_orders, exterior, outside, about, limit, model
                )
                if not np.all(np.isfinite(followed)):  # where the window came to has no field
                    ended = LOST
            if ended == LOST and not stable:
                return gaps, LOST, fields, tangents, orders
            stable = False
        progress = np.abs(moved[:width] - window[:width]).max()
        result = np.empty(gaps.shape)
        for i in range(count):
            k = (first + i) % count
            turn = 2 * np.pi if first + i >= count else 0.0
            for side in range(2):
                if i < width:
                    result[k, side] = moved[i, side] - turn
                else:
                    sign = 1 - 2 * side
                    result[k, side] = gaps[k, side] + sign * followed[2 * (i - width) + side]
            if i < width:
                orders[k] = max(orders[k], moved_orders[i])
        gaps = result
        if ended == NARROW or shortest_length(gaps) < law.smallest:
            return gaps, NARROW, fields, tangents, orders
        if progress > law.rest_step:
            half = _HALF_WIDTH
        elif 2 * half + 1 >= count - 2 or half >= _WIDEST:
            return gaps, RESTING, fields, tangents, orders
        else:
            half = min(2 * half, _WIDEST)
    return gaps, UNFINISHED, fields, tangents, orders
