"""Descent of many gaps in windows: where edges run, the rest responding linearly; compiled.

In a jump a few edges run at a time. The gaps around them are a window whose edges descend as those
of few gaps do (``gradient_flow``); all other gaps are what the
window feels of them (``exterior``), their edges following by their
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
from adhesis.solver.sharp.equilibrium.edge_elimination import newton_step, yielding_gaps
from adhesis.solver.sharp.equilibrium.griffith import (
    Law,
    at_least,
    imbalance,
    moved_gaps,
    narrowest,
    step_limits,
)
from adhesis.solver.sharp.equilibrium.linear_exterior import About, following, open_window
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.full_contact_stress import Panels, with_outside
from adhesis.solver.sharp.gap.quadrature import Kinds, Rules, choose_kinds

_HALF_WIDTH = 4  # gaps of a window on each side of the edge that leads
_WIDEST = 48
_STEPS = 60  # steps in a window before everything is solved anew
_LOUD = 0.02  # imbalance, of C_c, above which the furthest edge leads
_CALM = 0.2  # an edge outside follows its tangent if that moves it by less, in longest steps
_NEWTON_STEPS = 12  # steps of all edges in a row


@compiled
def _leading_gap(residual: Array, step: Array, law: Law) -> int:
    """Gap of the edge around which a window is put."""
    if np.abs(residual).max() > _LOUD * law.critical:
        return int(np.argmax(np.abs(residual))) // 2
    return int(np.argmax(np.abs(step))) // 2


@compiled
def descend_many(
    gaps: Array,
    prescribed: float,
    most: int,
    least: Kinds,
    equal_speeds: bool,
    law: Law,
    rules: Rules,
    panels: Panels,
) -> tuple[Array, int, int, int, Kinds]:
    """As ``gradient_flow.descend``, for many gaps."""
    fields = 0
    tangents = 0
    count = gaps.shape[0]
    half = _HALF_WIDTH
    newton = 0
    kinds = least
    while fields < most:
        table = map_gaps(gaps)
        kinds = at_least(choose_kinds(table, law.digits, rules.counts), kinds)
        of, parts = solve_many(gaps, prescribed, law.hold, kinds, law.digits, 2, rules, panels)
        fields += 1
        tangents += 1
        if not np.isfinite(of.pressure):
            return gaps, LOST, fields, tangents, kinds
        residual, drift = imbalance(of, law, panels)
        edges = yielding_gaps(of, parts, residual, drift, rules)
        step, _, _, stable, _ = newton_step(of, parts, edges, law.hold)
        size = np.abs(step).max()
        if stable and size < law.near:
            return moved_gaps(gaps, step), RESTING, fields, tangents, kinds
        limit = step_limits(table, law.longest)
        if stable and newton < _NEWTON_STEPS and np.all(np.abs(step) <= limit):
            newton += 1
            gaps = moved_gaps(gaps, step)
            continue
        newton = 0
        width = min(2 * half + 1, count - 2)
        first = (_leading_gap(residual, step, law) - width // 2) % count
        calm = _CALM * law.longest
        about = About(of, parts.w, parts.blocks, parts.inverse, edges)
        window, outside, outer = open_window(about, first, width, calm, law, rules, panels)
        window_kinds = np.zeros(width + 1, dtype=np.int64)
        for i in range(width):
            window_kinds[i] = kinds[(first + i) % count]
        moved, ended, moved_kinds = window, LOST, window_kinds
        followed = np.empty(0)
        soft = outer.response.negative == 0
        while ended == LOST:
            if not soft:  # with all edges outside held
                window, outside, outer = open_window(about, first, width, 0.0, law, rules, panels)
            moved, ended, some, more, moved_kinds, _, _, _ = descend(
                window, prescribed, min(_STEPS, most - fields), window_kinds, equal_speeds, law,
                rules, with_outside(panels, outside), np.empty((0, window.size)), False,
            )  # fmt: skip
            fields += some
            tangents += more
            if ended != LOST:
                followed = following(
                    moved, prescribed, moved_kinds, outer, about, limit, law, rules,
                    with_outside(panels, outside),
                )  # fmt: skip
                if not np.all(np.isfinite(followed)):  # where the window came to has no field
                    ended = LOST
            if ended == LOST and not soft:
                return gaps, LOST, fields, tangents, kinds
            soft = False
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
                kinds[k] = max(kinds[k], moved_kinds[i])
        gaps = result
        if ended == NARROW or narrowest(gaps) < law.smallest:
            return gaps, NARROW, fields, tangents, kinds
        if progress > law.near:
            half = _HALF_WIDTH
        elif 2 * half + 1 >= count - 2 or half >= _WIDEST:
            return gaps, RESTING, fields, tangents, kinds
        else:
            half = min(2 * half, _WIDEST)
    return gaps, UNFINISHED, fields, tangents, kinds
