"""Newton's iteration and the descent with their control flow in Python, for comparison.

The response, its renewal, the condensed tangent and the flow through the model are kernels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver import _kernels  # type: ignore[attr-defined]
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.implicit_flow import (
    AT_REST,
    NO_FIELD,
    OUTGROWN,
    STEP_LIMIT,
    VANISHED,
    Descent,
)
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.field.solution import FieldModel
from adhesis.solver.sharp.gap.ends import lengths_of, outward
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.native import law_of, model_of
from adhesis.solver.sharp.tolerances import (
    CLOSING_SHARE,
    DAMPING_GROWTH,
    FOLLOWING,
    FURTHEST_FOLLOWING,
    HIERARCHICAL_NEWTON_GROWTH,
    LEAST_DAMPING,
    LEAST_REACH,
    LONG_CLOSING,
    LONGEST_REACH,
    MODEL_ERROR,
    MODEL_SHARE,
    MOST_CORRECTIONS,
    MOST_DAMPING,
    REACH_CUT,
    REACH_GROWTH,
    REACH_SAFETY,
    RUNNING,
    RUNNING_LENGTH,
    SHORT_REACH,
    SHORTEST_REACH,
    SOFT_SHARE,
    STALLED_SHARE,
)

Flags = NDArray[np.bool_]


class Equilibrium(NamedTuple):
    """As ``hierarchical_newton.EquilibriumOfMany``."""

    found: bool
    is_outgrown: bool
    gaps: Array
    potential: Array
    rate: Array
    pressure: float
    separation: float
    slope: float
    corrections: int


def _shortest(gaps: Array) -> float:
    edges = gaps.ravel()
    return float(min(np.diff(edges).min(), edges[0] + 2 * np.pi - edges[-1]))


def equilibrium_many(
    response: Any, gaps: Array, prescribed: float, reach: float, strict: bool, law: EdgeLaw,
    model: FieldModel,
) -> Any:  # fmt: skip
    """Find the equilibrium next to ``gaps``."""
    kernel, of_law, of_model = response.kernel, law_of(law), model_of(model)
    undamped = np.zeros(gaps.size)
    travelled: Array = undamped
    sign = outward(gaps)
    last, judged_again, found, is_outgrown, steps = np.inf, False, False, False, 0
    pressure = kernel.pressure_at(prescribed, of_model)
    now = None
    while True:
        steps += 1
        if not kernel.move_references(
            gaps, undamped, pressure, prescribed, of_law, of_model
        ):
            is_outgrown = True
            break
        now = kernel.solve(prescribed, of_law, of_model)
        pressure = now.pressure
        if not np.isfinite(pressure):
            break
        if strict and not now.stable:
            if judged_again or not kernel.any_outdated(gaps, of_law):
                break
            judged_again = True  # the first time the tangent was that of an outdated reference
            continue
        step = now.motion - kernel.motion_to(gaps)
        size = float(np.abs(step).max())
        travelled = travelled + step
        stalled = size <= law.field_error and size > STALLED_SHARE * last
        # not written as > : a size that is no number is a failure, too
        most = max(HIERARCHICAL_NEWTON_GROWTH * last, law.rest_step)
        moved = gaps + (sign * step).reshape(-1, 2)
        within = size <= min(reach, most) and np.abs(travelled).max() <= reach
        if not (within and _shortest(moved) > 0):
            break
        gaps = moved
        at_rest = stalled or (not strict and size <= law.rest_step)
        if at_rest or not kernel.any_outdated(gaps, of_law):
            found = True
            break
        if steps == MOST_CORRECTIONS:
            break
        last = size
    if now is None:
        return Equilibrium(
            found, is_outgrown, gaps, undamped, undamped, pressure, np.nan, np.nan, steps
        )
    return Equilibrium(
        found, is_outgrown, gaps, kernel.potential_at(pressure), now.rate, pressure,
        now.separation, now.slope, steps,
    )  # fmt: skip


def _model_error(flow: Any, residual: Array, critical: Array, law: EdgeLaw) -> float:
    """Measure by how much the openings of the model are wrong, in units of what is allowed."""
    lengths = flow.lengths
    if not len(lengths):
        return 0.0
    at_end = np.abs(residual + critical - flow.opening)
    error = ((lengths / lengths[-1]) ** 2)[:, None] * at_end
    unbalance = np.maximum(np.abs(flow.residuals) - error, 0.0)
    worst = float((error / (MODEL_ERROR * law.critical + MODEL_SHARE * unbalance)).max())
    return np.inf if np.isnan(worst) else worst


def _next_reach(before: float, length: float, error: float) -> float:
    """Choose the next reach after a long step of this length, in longest steps, and error."""
    factor = min(REACH_GROWTH, max(REACH_CUT, REACH_SAFETY / np.sqrt(max(error, 1e-9))))
    reach = float(length * factor)
    if error <= 1:
        reach = max(reach, before if factor >= 1 else 0.0)
    return max(min(reach, LONGEST_REACH), SHORTEST_REACH)


def _limits(gaps: Array, longest: float, share: float) -> Array:
    length, patch = lengths_of(gaps)
    beside = np.stack([np.roll(patch, 1), patch], axis=1)
    return np.asarray(np.minimum(longest, share * np.minimum(length[:, None], beside)).ravel())


def _let_run(runs: Flags, which: Flags) -> bool:
    more = bool((which & ~runs).any())
    runs |= which
    return more


def descend(
    response: Any, gaps: Array, prescribed: float, most: int, equal_speeds: bool, runs: Flags,
    reach: float, law: EdgeLaw, model: FieldModel,
) -> Descent:  # fmt: skip
    """Descend in energy until an event."""
    kernel, of_law, of_model = response.kernel, law_of(law), model_of(model)
    sign, edges = outward(gaps), np.flatnonzero(runs)
    before, flow = gaps, _kernels.ModelFlow
    pressure = kernel.pressure_at(prescribed, of_model)
    strongest, event, steps, damped = 0.0, STEP_LIMIT, 0, LEAST_DAMPING
    moved, judges = True, False
    residual, here, stiff = kernel.edge_values()
    damping = damped * stiff * runs
    while steps < most:
        if moved:
            if not kernel.move_references(
                gaps, damping, pressure, prescribed, of_law, of_model
            ):
                event = OUTGROWN
                break
        else:
            kernel.damp(gaps, damping, of_model)
        steps, moved, condensed = steps + 1, False, None
        now = kernel.solve(prescribed, of_law, of_model)
        residual, here, stiff = kernel.edge_values()
        if not np.isfinite(now.pressure):
            event = NO_FIELD
            break
        if not now.stable:
            softness = kernel.softness
            soft = np.repeat(softness > SOFT_SHARE * softness.max(), 2)
            if not _let_run(runs, soft | (damped > DAMPING_GROWTH)):
                damped *= DAMPING_GROWTH
            if damped > MOST_DAMPING:
                if not judges:
                    event = NO_FIELD
                    break
                gaps, judges, moved = before, False, True  # the step was too long
                damped, reach = LEAST_DAMPING, max(REACH_CUT * reach, SHORTEST_REACH)
            damping = damped * stiff * runs
            continue
        pressure = now.pressure
        if judges:
            judges = False
            condensed = _kernels.CondensedEdges(kernel, edges, now, of_model)
            critical = _kernels.critical_openings(gaps.ravel()[edges], of_law, of_model)
            error = _model_error(flow, condensed.residual(now), critical, law)
            length = float(np.abs(flow.motion).max(initial=0.0)) / law.longest_step
            reach = _next_reach(reach, length, error)
            if error > 1 and length > 1.5 * SHORTEST_REACH:
                gaps, moved = before, True
                continue
        far_ahead = np.abs(now.motion - here) > FOLLOWING * law.longest_step
        if _let_run(runs, (np.abs(residual) > RUNNING * law.critical) | far_ahead):
            damping = damped * stiff * runs
            continue
        some: Integers = np.flatnonzero(runs | np.roll(runs, 1) | np.roll(runs, -1))
        if condensed is None or len(some) != len(edges):
            edges = some
            condensed = _kernels.CondensedEdges(kernel, edges, now, of_model)
        unbalance = condensed.residual(now)
        critical = _kernels.critical_openings(gaps.ravel()[edges], of_law, of_model)
        opening = unbalance + critical
        force = float(np.linalg.norm(critical**2 - opening * np.abs(opening)))
        strongest = max(strongest, force)
        is_long = bool(reach >= LEAST_REACH) and not _kernels.near_balance(
            force, strongest, of_law
        )
        while True:
            longest, share = min(reach, SHORT_REACH) * law.longest_step, CLOSING_SHARE
            if is_long:
                longest, share = reach * law.longest_step, LONG_CLOSING
            limit = _limits(gaps, longest, share)[edges]
            flow = condensed.flow(
                gaps, unbalance, limit, equal_speeds, is_long, strongest, of_law, of_model
            )
            motion = flow.motion
            way, pressure = condensed.follow(here[edges] + motion, now)
            way -= here
            way[edges] = motion  # without rounding
            too_far = ~(np.abs(way) <= FURTHEST_FOLLOWING * law.longest_step)
            too_far[edges] = False
            far = bool(too_far.any())
            there = gaps + (sign * way).reshape(-1, 2)
            vanished = _shortest(there) < law.smallest
            runs_on = flow.is_at_limit or (
                np.abs(motion).max(initial=0.0) > RUNNING_LENGTH * law.longest_step
            )
            if far or not is_long or (runs_on and not vanished):
                break
            is_long = False
            now = kernel.solve(prescribed, of_law, of_model)
        if far:
            runs |= too_far
            damping = damped * stiff * runs
            continue
        judges = len(edges) > 0
        before, gaps, moved = gaps, there, True
        if vanished:
            event = VANISHED
            break
        if np.abs(way).max() < law.rest_step and not flow.is_at_limit:
            event = AT_REST
            break
        damping = damped * stiff * runs
    return Descent(event, gaps, steps, reach)
