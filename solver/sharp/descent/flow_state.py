"""State of a descent between two fields, and the transitions of that state, compiled.

A step is judged at its end, from the forces there: it is kept, cut short before a minimum that it
leapt over, or taken back. Only then the next one is chosen.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.edge_forces import (
    ForceRows,
    Forces,
    energy_change,
    force_rates,
)
from adhesis.solver.sharp.descent.step_size import (
    StepLengths,
    StepSize,
    after_cut,
    after_fall,
    after_rejection,
    after_turn,
    initial_size,
    next_lengths,
    running_edges,
    with_running,
)
from adhesis.solver.sharp.equilibrium.griffith import move_edges
from adhesis.solver.sharp.field.force_along_step import first_zero, force_derivatives
from adhesis.solver.sharp.gap.quadrature import GaussRules, Integers
from adhesis.solver.sharp.tolerances import ENERGY_ROUNDING, LEAST_STEP_SHARE, STANDING_SHARE


class LongStep(NamedTuple):
    """Edges that ran so far in a step that they may have leapt over a minimum.

    Attributes
    ----------
    edges : int array
        Empty if the step was short.
    rates : array
        Derivatives of the forces on them along the step, at its start.
    """

    edges: Integers
    rates: Array


class State(NamedTuple):
    """Edges after a step that has not been judged yet.

    Attributes
    ----------
    gaps : array, shape (L, 2)
        After the step.
    start : array, shape (L, 2)
        PreviousPoint it.
    step : array, shape (2L,)
        Outward motion of the contact at every edge; zero where there was no step.
    slope : array, shape (2L,)
        dU/dn before the step.
    long : LongStep
    size : StepSize
    """

    gaps: Array
    start: Array
    step: Array
    slope: Array
    long: LongStep
    size: StepSize


@compiled
def no_long_step() -> LongStep:
    """Note that no edge ran far."""
    return LongStep(np.empty(0, dtype=np.int64), np.empty(0))


@compiled
def initial_state(gaps: Array) -> State:
    """Begin a descent at these gaps."""
    nothing = np.zeros(2 * gaps.shape[0])
    return State(gaps, gaps, nothing, nothing, no_long_step(), initial_size())


# ------------------------------------------------------------------ judgement of a step


@compiled
def share_to_minimum(state: State, now: Forces, rows: ForceRows, rules: GaussRules) -> float:
    """Find the share of a long step after which the force on a running edge vanishes, or 1."""
    edges, before = state.long.edges, state.long.rates
    if edges.shape[0] == 0:
        return 1.0
    force_derivatives(now.solution, edges, rules, rows.values, rows.known)
    step, slope, slope_now = state.step, state.slope, now.slope
    rates = force_rates(now, step, edges, rows.values)
    share = 1.0
    for i in range(edges.shape[0]):
        e = edges[i]
        onwards = -np.sign(step[e])
        fallen = first_zero(onwards * slope[e], before[i], onwards * slope_now[e], rates[i])
        share = min(share, fallen)
    return share


@compiled
def accepted_share(state: State, slope: Array, to_minimum: float) -> float:
    """Judge the last step: the share of it that is kept.

    It is 1 for a step that is accepted and 0 for one that raised the energy by more than rounding;
    a long step over a minimum is kept up to that minimum. ``slope`` is dU/dn after the step.
    """
    if to_minimum < 1:
        return to_minimum
    change, work = energy_change(state.slope, slope, state.step)
    rose = change > ENERGY_ROUNDING * work and state.size.share > LEAST_STEP_SHARE
    return 0.0 if rose else 1.0


@compiled
def taken_back(state: State, share: float) -> State:
    """Put the edges where they were after a ``share`` of the last step: 0 rejects the step."""
    if share > 0:
        gaps, size = move_edges(state.start, share * state.step), after_cut(state.size)
    else:
        gaps, size = state.start, after_rejection(state.size)
    stand = np.zeros(state.step.shape[0])
    return State(gaps, gaps, stand, state.slope, no_long_step(), size)


@compiled
def accepted(state: State, slope: Array) -> State:
    """Keep the last step: the edges stand where it led, with dU/dn = ``slope``."""
    _, work = energy_change(state.slope, slope, state.step)
    size = after_fall(state.size) if work > 0 else state.size
    return State(state.gaps, state.gaps, state.step, slope, no_long_step(), size)


# ------------------------------------------------------------------ the next step


@compiled
def bounded(state: State, longest: float) -> tuple[State, StepLengths]:
    """Choose the lengths that bound the next step, ``longest`` being a full one."""
    size, lengths = next_lengths(state.size, longest)
    return State(state.gaps, state.start, state.step, state.slope, state.long, size), lengths


@compiled
def turned(state: State) -> State:
    """Stand, for a new tangent, where an edge would turn by an old one."""
    stand = np.zeros(state.step.shape[0])
    return State(
        state.gaps, state.gaps, stand, state.slope, no_long_step(), after_turn(state.size)
    )


@compiled
def moved(
    state: State,
    step: Array,
    now: Forces,
    lengths: StepLengths,
    limit: Array,
    rows: ForceRows,
    rules: GaussRules,
) -> State:
    """Take a step from a state that was accepted; ``step`` is changed in place.

    While edges run, small motions of the others are left out: what belongs to gaps that have not
    changed is not computed anew. A step longer than an unchecked one is noted, to be judged at its
    end, or shortened if an edge in it runs against its own force, drawn by others.
    """
    long = no_long_step()
    running = running_edges(step, lengths.longest)
    if running.shape[0] > 0:
        size = np.abs(step).max()
        for e in range(step.shape[0]):
            if abs(step[e]) < STANDING_SHARE * limit[e]:
                step[e] = 0.0
        if size > lengths.unchecked:
            if np.any(now.slope[running] * step[running] >= 0):
                step *= lengths.unchecked / size
            else:
                force_derivatives(now.solution, running, rules, rows.values, rows.known)
                long = LongStep(running, force_rates(now, step, running, rows.values))
    size_control = with_running(state.size, running.shape[0])
    gaps = move_edges(state.gaps, step)
    return State(gaps, state.gaps, step, now.slope, long, size_control)
