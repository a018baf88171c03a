"""Short step of a descent, compiled: on the linear flow, or off a saddle."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.bound_constrained_step import bound_constrained_step
from adhesis.solver.sharp.descent.edge_forces import FlowProblem, Forces
from adhesis.solver.sharp.descent.linear_kinetics import flow_step, hessian
from adhesis.solver.sharp.descent.saddle import QuadraticModel, step_off_saddle
from adhesis.solver.sharp.equilibrium.griffith import symmetrise
from adhesis.solver.sharp.equilibrium.pinning import stop_at_band
from adhesis.solver.sharp.field.cholesky import cholesky, solve_column
from adhesis.solver.sharp.gap.quadrature import Integers


@compiled
def short_step(
    gaps: Array, prescribed: float, orders: Integers, now: Forces, tangent: Array, limit: Array,
    equal_speeds: bool, problem: FlowProblem,
) -> tuple[Array, Array, int]:  # fmt: skip
    """Choose a step within the limits: outward motions, curvature of the energy, fields solved.

    By linear kinetics edges move in proportion to their excess energy release rates. With equal
    speeds, for comparison, edges out of equilibrium run, all at the same speed (their limit), and
    edges near equilibrium follow them by Newton's step.
    """
    motion, curvature, tried = free_step(
        gaps, prescribed, orders, now, tangent, limit, equal_speeds, problem
    )
    if problem.law.pinning > 0:
        stop_at_band(gaps.ravel(), motion, problem.law)
    return motion, curvature, tried


@compiled
def free_step(
    gaps: Array, prescribed: float, orders: Integers, now: Forces, tangent: Array, limit: Array,
    equal_speeds: bool, problem: FlowProblem,
) -> tuple[Array, Array, int]:  # fmt: skip
    """Choose a short step of edges that stop nowhere."""
    law, opening = problem.law, now.solution.opening
    curvature = hessian(np.maximum(opening, 0.0), now.residual, now.drift, tangent)
    if equal_speeds:
        values, matrix = symmetrise(now.solution, tangent, law.overlap_limit)
        step = bound_constrained_step(matrix, values, -now.residual, limit)
    else:
        step, is_within = newton_within(curvature, -now.slope, limit)
        if is_within:
            close_overlaps(step, opening, limit, law.overlap_limit)
            return step, curvature, 0
        values, matrix = np.linalg.eigh(curvature)
        step = flow_step(values, matrix, -now.slope, limit, law.force_error)
    model = QuadraticModel(values, matrix, limit)
    close_overlaps(step, opening, limit, law.overlap_limit)
    tried = 0
    if np.abs(step).max() <= law.field_error:
        step, tried = step_off_saddle(step, model, gaps, prescribed, orders, equal_speeds, problem)
    return step, curvature, tried


@compiled
def newton_within(curvature: Array, force: Array, limit: Array) -> tuple[Array, bool]:
    """Take Newton's step, at whose end the linear flow rests; also returns whether it may be taken.

    It may where the curvature is positive and no edge goes beyond its limit.
    """
    factor, definite = cholesky(curvature)
    step = force.copy()
    if definite:
        solve_column(factor, step)
        definite = bool(np.all(np.abs(step) <= limit))
    return step, definite


@compiled
def close_overlaps(step: Array, opening: Array, limit: Array, overlapping: float) -> None:
    """Let contact grow as far as it may at edges beside which surfaces would overlap."""
    for e in range(step.shape[0]):
        if opening[e] < -overlapping:
            step[e] = limit[e]
